//! The plane, the rabbit and the lamp.

use glam::{Quat, Vec3};
use lunette_bake::{SphereOptions, fit_spheres};
use lunette_relight::lobe::{
    Blockers, Lamp, Motion, Options, Points, Policy, Scene, Scratch, SphereSet, Target, add_irradiance,
};
use lunette_scenes::builtin;

/// Heights of the rabbit's feet over the plane, metres; the rabbit is 1 m high.
pub const HEIGHTS: [f32; 3] = [0.0, 0.6, 1.2];
/// Side of the plane, metres.
const SIDE: f32 = 5.0;

/// A mesh 1 m high, feet at the origin.
pub struct Body {
    pub name: &'static str,
    pub position: Vec<Vec3>,
    pub index: Vec<[u32; 3]>,
}

impl Body {
    fn new(name: &'static str, position: &[Vec3], index: Vec<[u32; 3]>) -> Body {
        let corners = || index.iter().flatten().map(|&v| position[v as usize]);
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let foot = (0.5 * (low + high)).with_y(low.y);
        let position = position.iter().map(|p| (p - foot) / (high.y - low.y)).collect();
        Body { name, position, index }
    }

    /// As 64 spheres; says how well.
    pub fn fit(&self) -> SphereSet {
        let started = std::time::Instant::now();
        let fit =
            fit_spheres(&self.position, &self.index, &SphereOptions::default()).expect("a body has a volume");
        println!(
            "\n{}: {} triangles, {} spheres in {:.2} s; of the volume {:.1} % too much, {:.1} % missing; surface off \
             by {:.2} % of the diagonal",
            self.name,
            self.index.len(),
            fit.set.spheres().len(),
            started.elapsed().as_secs_f64(),
            100.0 * fit.outside,
            100.0 * fit.missing,
            100.0 * fit.surface
        );
        fit.set
    }
}

/// The rabbit of the built-in room.
pub fn rabbit() -> Body {
    let scene = builtin::build("box-room").expect("a built-in scene");
    let group = scene.groups.iter().position(|name| name == "rabbit").expect("the room has a rabbit") as u32;
    let faces = scene.mesh.index.iter().zip(&scene.mesh.group).filter(|(_, g)| **g == group);
    Body::new("rabbit", &scene.mesh.position, faces.map(|(t, _)| *t).collect())
}

/// The Stanford bunny, where its file lies beside the workspace.
pub fn bunny() -> Option<Body> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/assets/objects/stanford-bunny.obj");
    let loaded = lunette_scenes::load(file, &lunette_scenes::LoadOptions::default());
    match loaded {
        Ok(scene) => Some(Body::new("Stanford bunny", &scene.mesh.position, scene.mesh.index)),
        Err(_) => {
            println!("\nno Stanford bunny at {file}: left out");
            None
        }
    }
}

/// n × n points on the plane y = 0, facing up.
pub struct Plane {
    pub position: Vec<[f32; 3]>,
    pub normal: Vec<[f32; 3]>,
}

pub fn plane(n: usize) -> Plane {
    let at = |i: usize| ((i as f32 + 0.5) / n as f32 - 0.5) * SIDE;
    let position = (0..n * n).map(|k| [at(k % n), 0.0, at(k / n)]).collect();
    Plane { position, normal: vec![[0.0, 1.0, 0.0]; n * n] }
}

pub fn lamp() -> Lamp {
    lamp_of(0.4)
}

pub fn lamp_of(radius: f32) -> Lamp {
    Lamp::new(Vec3::new(1.2, 5.0, 0.8), radius, Vec3::ONE).expect("a lamp")
}

/// Where the body stands at a height.
pub fn motion(height: f32) -> Motion {
    Motion { rotation: Quat::from_rotation_y(0.4), translation: Vec3::Y * height }
}

pub fn blockers(body: &SphereSet, height: f32) -> Blockers {
    let mut blockers = Blockers::default();
    blockers.push(body, &motion(height));
    blockers
}

/// The paper's options: partly hidden cells shine.
pub fn aggressive() -> Options {
    Options { policy: Policy::Aggressive, threshold: 1e-3, ..Options::default() }
}

/// Partly hidden cells are as dark as they are hidden: the command line's options.
pub fn proportional() -> Options {
    Options { policy: Policy::Proportional, ..aggressive() }
}

/// One frame, by as many threads as there are scratches; slices are dealt in turn, so that shadows are shared.
pub fn frame(
    plane: &Plane,
    blockers: &Blockers,
    options: &Options,
    scratch: &mut [Scratch],
    light: &mut [[f32; 3]],
) {
    let lamps = [lamp()];
    let scene = Scene { lamps: &lamps, blockers };
    let n_threads = scratch.len();
    let points = plane.position.chunks(SLICE).zip(plane.normal.chunks(SLICE));
    if let [one] = scratch {
        let points = Points { position: &plane.position, normal: &plane.normal };
        add_irradiance(&points, &scene, options, one, &mut Target { light, products: None });
        return;
    }
    let mut hands: Vec<Vec<_>> = (0..n_threads).map(|_| Vec::new()).collect();
    for (k, ((position, normal), light)) in points.zip(light.chunks_mut(SLICE)).enumerate() {
        hands[k % n_threads].push((Points { position, normal }, light));
    }
    std::thread::scope(|scope| {
        for (hand, scratch) in hands.into_iter().zip(scratch) {
            let scene = &scene;
            scope.spawn(move || {
                for (points, light) in hand {
                    let mut target = Target { light, products: None };
                    add_irradiance(&points, scene, options, scratch, &mut target);
                }
            });
        }
    });
}

/// Points dealt to a thread at once.
const SLICE: usize = 512;
