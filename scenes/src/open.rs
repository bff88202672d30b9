//! The way in: a file or a name becomes a [`Scene`].

use std::path::Path;

use glam::Vec3;

use crate::scene::{Error, Scene};
use crate::{builtin, obj, ply, terrain};

/// Name of the material of faces that have none, and of the group of faces that are in none.
pub(crate) const DEFAULT: &str = "default";

/// The axis of a file that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// As everything in Lunette.
    #[default]
    Y,
    /// As in CAD, GIS and Blender: x east, y north. Becomes x east, -z north.
    Z,
}

/// How to read a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// The axis of a mesh file that points up; terrains know theirs.
    pub up: Up,
    /// Metres per unit of the file, above 0.
    pub scale: f32,
    /// Terrains: factor for heights, on top of what the file says, above 0.
    pub vertical_scale: f32,
    /// Where a mesh has no normals: largest angle between two faces that still counts as smooth, radians, 0..=pi.
    ///
    /// The default of 40 degrees lies between the 36 degrees of a ten-sided column, which is meant to look round, and
    /// the 45 degrees of a chamfer or an octagonal one, which is not.
    pub crease_angle: f32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions { up: Up::Y, scale: 1.0, vertical_scale: 1.0, crease_angle: 40.0_f32.to_radians() }
    }
}

impl Up {
    /// A vector of the file with Y up.
    pub(crate) fn to_y(self, v: Vec3) -> Vec3 {
        match self {
            Up::Y => v,
            Up::Z => Vec3::new(v.x, v.z, -v.y),
        }
    }
}

/// Loads a mesh (`.obj`, `.ply`) or a terrain (`.asc`, `.dem`, `.hgt`, `.png`, `.tif`), or makes the built-in scene
/// of that name (`NAME[:key=value,...]`). The ending may be in capitals.
///
/// # Errors
/// [`Error`] if there is no such file or built-in scene, if the file is wrong beyond mending, or if an option is out
/// of its range.
pub fn load(scene: &str, options: &LoadOptions) -> Result<Scene, Error> {
    check(options)?;
    let path = Path::new(scene);
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match ending.as_str() {
        "obj" => obj::load(path, options),
        "ply" => ply::load(path, options),
        "asc" | "dem" | "hgt" | "png" | "tif" | "tiff" => terrain::load(path, options),
        // Before what exists: a folder may well be called `terrain`.
        _ if builtin::is_name(scene) => builtin::build(scene),
        _ if path.exists() => Err(Error::Invalid {
            at: scene.to_owned(),
            what:
                "not a kind of file that can be read; there are .obj, .ply, .asc, .dem, .hgt, .png and .tif"
                    .into(),
        }),
        _ => Err(Error::Builtin { what: unknown(scene) }),
    }
}

/// The bytes of a file that is not empty.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    if bytes.is_empty() {
        return Err(Error::Invalid { at: path.display().to_string(), what: "the file is empty".into() });
    }
    Ok(bytes)
}

fn check(options: &LoadOptions) -> Result<(), Error> {
    let refuse = |at: &str, value: f32, range: &str| {
        Err(Error::Invalid { at: at.to_owned(), what: format!("has to be {range}, not {value}") })
    };
    let positive = |value: f32| value > 0.0 && value.is_finite();
    match options {
        o if !positive(o.scale) => refuse("scale", o.scale, "a positive number"),
        o if !positive(o.vertical_scale) => refuse("vertical scale", o.vertical_scale, "a positive number"),
        o if !(0.0..=std::f32::consts::PI).contains(&o.crease_angle) => {
            refuse("crease angle", o.crease_angle, "from 0 to pi radians")
        }
        _ => Ok(()),
    }
}

fn unknown(scene: &str) -> String {
    const SHOWN: usize = 3;
    let name = scene.split(':').next().unwrap_or_default();
    let mut names: Vec<&str> = builtin::list().iter().map(|b| b.name).collect();
    names.sort_by_key(|candidate| unlikeness(name, candidate));
    names.truncate(SHOWN);
    format!("{scene}: no such file, and no built-in scene of that name; the nearest are {}", names.join(", "))
}

/// Letters to insert, delete or replace to get from one name to the other; nothing for what is missing at the ends,
/// so that `sphere` is near `sphere-on-plane`.
fn unlikeness(typed: &str, name: &str) -> usize {
    let name: Vec<char> = name.to_lowercase().chars().collect();
    let mut row = vec![0; name.len() + 1];
    for (i, t) in typed.to_lowercase().chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &n) in name.iter().enumerate() {
            let best = (diagonal + usize::from(t != n)).min(row[j] + 1).min(row[j + 1] + 1);
            diagonal = std::mem::replace(&mut row[j + 1], best);
        }
    }
    row.into_iter().min().unwrap_or_default()
}
