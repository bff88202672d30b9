//! Scenes that are made, not loaded: those of the papers, and some that are good to look at.
//!
//! All are in metres, tessellated to a longest edge so that light per vertex looks right, split at creases, with
//! the outside of every surface in front. Rooms are closed: light comes in only through the openings, which hold
//! panes of a material whose name begins with `glass`.
//!
//! The cylinder on a plane and the horizon band are those of: Oat & Sander, Ambient Aperture Lighting, 2007; the
//! room, the skylight box, the chapel and the car stand for those of: Yue et al., Interactive Rendering of
//! Interior Scenes with Dynamic Environment Illumination, 2009, whose own meshes are not free.

mod blob;
mod car;
mod chapel;
mod courtyard;
mod draft;
mod erosion;
mod fractal;
mod rooms;
mod shapes;
mod simple;
mod solid;
mod spec;
#[cfg(test)]
mod tests;
mod town;

use glam::Vec3;

use crate::{Error, Scene};
use spec::Values;
pub use spec::{Kind, Parameter};

/// A scene that can be had by name.
#[derive(Debug)]
pub struct Builtin {
    /// As in the spec.
    pub name: &'static str,
    /// One line about it.
    pub what: &'static str,
    /// What can be asked of it.
    pub parameters: &'static [Parameter],
    /// Makes it; says in words what does not go together.
    make: fn(&Values) -> Result<Scene, String>,
}

/// All built-in scenes.
pub fn list() -> &'static [Builtin] {
    BUILTINS
}

/// Whether a spec means a built-in scene, right or wrong in its parameters.
pub fn is_name(spec: &str) -> bool {
    let name = spec.split(':').next().unwrap_or_default();
    BUILTINS.iter().any(|b| b.name == name.trim())
}

/// Makes the scene of a spec, `NAME[:key=value,key=value]`.
///
/// # Errors
/// [`Error::Builtin`] for an unknown name or parameter, a value out of its range, or values that do not go
/// together.
pub fn build(spec: &str) -> Result<Scene, Error> {
    let (builtin, values) = spec::parse(spec)?;
    let mut scene =
        (builtin.make)(&values).map_err(|what| spec::wrong(format!("{}: {what}", builtin.name)))?;
    if let Some(albedo) = values.find("albedo") {
        let opaque = scene.materials.iter_mut().filter(|m| m.transmission == Vec3::ZERO);
        opaque.for_each(|m| m.albedo = Vec3::splat(albedo));
    }
    Ok(scene)
}

/// The parameter that all scenes share.
const ALBEDO: Parameter = Parameter {
    name: "albedo",
    what: "reflectance of every opaque surface; without it each has its own colour",
    default: None,
    low: 0.0,
    high: 1.0,
    kind: Kind::Real,
};

const fn real(name: &'static str, what: &'static str, default: f32, range: [f32; 2]) -> Parameter {
    Parameter { name, what, default: Some(default), low: range[0], high: range[1], kind: Kind::Real }
}

const fn whole(name: &'static str, what: &'static str, default: f32, range: [f32; 2]) -> Parameter {
    Parameter { name, what, default: Some(default), low: range[0], high: range[1], kind: Kind::Whole }
}

// The ranges are such that the finest and largest scene together stays below some 60 million triangles.
const BUILTINS: &[Builtin] = &[
    Builtin {
        name: "plane",
        what: "a level square under the open sky: every answer is known",
        parameters: &[
            real("size", "side, m", 10.0, [1e-3, 1e5]),
            whole("n", "squares along a side", 32.0, [1.0, 4096.0]),
            ALBEDO,
        ],
        make: simple::plane,
    },
    Builtin {
        name: "sphere-on-plane",
        what: "a sphere that rests on a level square",
        parameters: &[
            real("radius", "of the sphere, m", 1.0, [0.01, 10.0]),
            real("size", "side of the square, m", 8.0, [0.1, 100.0]),
            real("edge", "longest edge, m", 0.1, [0.025, 10.0]),
            ALBEDO,
        ],
        make: simple::sphere_on_plane,
    },
    Builtin {
        name: "cylinder-on-plane",
        what: "a post on a level square, the aperture paper's didactic scene: half of the sky is hidden beside it",
        parameters: &[
            real("radius", "of the cylinder, m", 0.5, [0.01, 10.0]),
            real("height", "of the cylinder, m", 2.0, [0.01, 50.0]),
            real("size", "side of the square, m", 8.0, [0.1, 100.0]),
            real("edge", "longest edge, m", 0.1, [0.025, 10.0]),
            ALBEDO,
        ],
        make: simple::cylinder_on_plane,
    },
    Builtin {
        name: "horizon-band",
        what: "a floor under a round canopy on thin air, the aperture paper's failing case: only a band at the \
               horizon is visible",
        parameters: &[
            real("radius", "of the canopy, m", 8.0, [0.1, 100.0]),
            real("height", "of the canopy over the floor, m", 1.0, [0.05, 50.0]),
            real("size", "side of the floor, m", 20.0, [0.1, 200.0]),
            real("edge", "longest edge, m", 0.25, [0.05, 10.0]),
            ALBEDO,
        ],
        make: simple::horizon_band,
    },
    Builtin {
        name: "terrain",
        what: "mountains worn by rivers, of any size, the same for the same seed",
        parameters: &[
            whole("n", "vertices along a side", 257.0, [2.0, 5001.0]),
            real("size", "side, m", 6000.0, [1.0, 1e6]),
            real("height", "from the lowest point to the highest, m", 900.0, [0.0, 1e5]),
            real("roughness", "how much each finer octave keeps of the last", 0.45, [0.0, 0.9]),
            whole("seed", "another number, other mountains", 1.0, [0.0, 16777215.0]),
            ALBEDO,
        ],
        make: fractal::terrain,
    },
    Builtin {
        name: "courtyard",
        what: "a paved court with arcades on four sides, a walk behind them, coloured walls and a fountain",
        parameters: &[
            real("size", "side of the open court, m", 12.0, [6.0, 40.0]),
            whole("columns", "between the corners of each side", 5.0, [1.0, 24.0]),
            real("edge", "longest edge, m", 0.25, [0.05, 2.0]),
            ALBEDO,
        ],
        make: courtyard::courtyard,
    },
    Builtin {
        name: "box-room",
        what: "a closed room with a window (`glass`) of any size in its west wall and a rabbit on the floor",
        parameters: &[
            real("window-width", "m", 1.6, [0.05, 4.6]),
            real("window-height", "m", 1.2, [0.05, 2.6]),
            whole("bars", "upright and as many level ones, in the glass", 0.0, [0.0, 8.0]),
            real("gloss", "Ks of the rabbit, whose Kd it leaves 1 - Ks of", 0.0, [0.0, 1.0]),
            real("exponent", "of the rabbit's Phong lobe", 10.0, [0.0, 1e4]),
            real("edge", "longest edge, m", 0.15, [0.02, 1.0]),
            ALBEDO,
        ],
        make: rooms::box_room,
    },
    Builtin {
        name: "rabbit",
        what: "a rabbit alone, standing at the origin and looking to +z: something to put into another scene",
        parameters: &[
            real("height", "m", 1.0, [0.01, 100.0]),
            whole("n", "edges along its height", 32.0, [17.0, 200.0]),
            ALBEDO,
        ],
        make: rooms::rabbit_alone,
    },
    Builtin {
        name: "skylight-box",
        what: "a closed room with a small opening (`glass`) in the ceiling",
        parameters: &[
            real("opening", "side of the opening, m", 0.6, [0.05, 3.4]),
            real("edge", "longest edge, m", 0.15, [0.02, 1.0]),
            ALBEDO,
        ],
        make: rooms::skylight_box,
    },
    Builtin {
        name: "chapel",
        what: "nave, aisles, apse and barrel vault, with arched windows (`glass`), a rose (`glass_rose`) and an \
               east window (`glass_east`)",
        parameters: &[
            whole("bays", "pairs of arches along the nave", 5.0, [1.0, 20.0]),
            real("edge", "longest edge, m", 0.3, [0.08, 2.0]),
            ALBEDO,
        ],
        make: chapel::chapel,
    },
    Builtin {
        name: "town",
        what: "boxes along a street, the same for the same seed",
        parameters: &[
            real("length", "of the street, m", 120.0, [20.0, 1000.0]),
            whole("seed", "another number, another town", 1.0, [0.0, 16777215.0]),
            real("edge", "longest edge, m", 2.0, [0.25, 20.0]),
            ALBEDO,
        ],
        make: town::town,
    },
    Builtin {
        name: "car",
        what: "a closed saloon car whose windows are `glass`, seats inside",
        parameters: &[real("edge", "longest edge, m", 0.08, [0.02, 0.5]), ALBEDO],
        make: car::car,
    },
];
