//! Portals in a file of their own beside the scene, `SCENE.portals.json`.
//!
//! ```json
//! {
//!   "format": "lunette-portals",
//!   "version": 1,
//!   "portals": [
//!     {
//!       "name": "west window",
//!       "transmission": [0.9, 0.9, 0.9],
//!       "polygons": [[[-2, 0.7, 0.5], [-2, 0.7, -0.5], [-2, 2.1, -0.5], [-2, 2.1, 0.5]]]
//!     }
//!   ]
//! }
//! ```
//!
//! Corners are in the coordinates that the scene has once it is loaded: right-handed, Y up, metres, *after* the up
//! axis and the scale of the scene's file have been applied; neither is applied to the sidecar. Polygons are flat,
//! three corners and more, concave ones allowed, counter-clockwise seen from the interior (where one is wound the
//! other way, rays find out). Each channel of `transmission`, the share of light let through, is from 0 to 1; left
//! out, it is 1, an open hole. All polygons of a portal share one shell of outside light. Other keys are refused, so
//! that a slip of the pen does not go unnoticed.

use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::Portal;
use crate::scene::Error;
use crate::{open, polygon, write_obj};

/// What the key `format` says.
pub const SIDECAR_FORMAT: &str = "lunette-portals";

/// The version that is written, and the only one there is.
pub const SIDECAR_VERSION: u32 = 1;

/// Farthest that a corner may lie from its polygon's plane, as a share of the polygon's size. Numbers typed with
/// three digits are within it; a quadrilateral between two storeys is not.
const FLATNESS: f64 = 0.02;

/// Farthest that a corner may lie from the origin, metres, as for meshes.
const MAX_COORDINATE: f32 = 1e8;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u32,
    portals: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    #[serde(default = "open_hole")]
    transmission: [f32; 3],
    polygons: Vec<Vec<[f32; 3]>>,
}

fn open_hole() -> [f32; 3] {
    [1.0; 3]
}

/// The sidecar of a scene: `room.obj` has `room.portals.json`, the built-in `chapel:bays=3` has
/// `chapel.portals.json` where the command runs.
pub fn sidecar_path(scene: &str) -> PathBuf {
    let file = if crate::builtin::is_name(scene) { scene.split(':').next().unwrap_or(scene) } else { scene };
    Path::new(file.trim()).with_extension("portals.json")
}

/// Reads a sidecar. Polygons become triangles wound as they are.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Invalid`], with line and column or portal and polygon, if it is no
/// such document, of another version, without portals, or if a name, a polygon or a transmission is wrong.
pub fn read_portals(path: &Path) -> Result<Vec<Portal>, Error> {
    let bytes = open::read(path)?;
    let at = path.display().to_string();
    parse(&bytes, &at)
}

/// Writes a sidecar, whole or not at all.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
pub fn write_portals(path: &Path, portals: &[Portal]) -> Result<(), Error> {
    let entry = |p: &Portal| Entry {
        name: p.name.clone(),
        transmission: p.transmission.to_array(),
        polygons: p.polygons().iter().map(|polygon| polygon.iter().map(|c| c.to_array()).collect()).collect(),
    };
    let document = Document {
        format: SIDECAR_FORMAT.into(),
        version: SIDECAR_VERSION,
        portals: portals.iter().map(entry).collect(),
    };
    write_obj::write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, &document)?;
        out.write_all(b"\n")
    })
}

fn parse(bytes: &[u8], at: &str) -> Result<Vec<Portal>, Error> {
    let syntax = |e: serde_json::Error| {
        let text = e.to_string();
        // The place leads, as with all files here.
        let what = text.split(" at line ").next().unwrap_or(&text).replace(['\n', '\r'], " ");
        Error::Invalid { at: format!("{at}:{}:{}", e.line(), e.column()), what }
    };
    // A file of another version may hold anything else, so that the head is looked at first.
    let head: serde_json::Value = serde_json::from_slice(bytes).map_err(syntax)?;
    check_head(&head).map_err(|what| invalid(at, what))?;
    let document: Document = serde_json::from_slice(bytes).map_err(syntax)?;
    if document.portals.is_empty() {
        return Err(invalid(at, "it has no portal; give one, or remove the file"));
    }
    let mut names = HashSet::new();
    let mut portals = Vec::new();
    for (i, entry) in document.portals.iter().enumerate() {
        if entry.name.trim().is_empty() {
            return Err(invalid(at, format!("portal {} has no name", i + 1)));
        }
        if !names.insert(&entry.name) {
            let name = &entry.name;
            return Err(invalid(at, format!("two portals are called '{name}'; put their polygons into one")));
        }
        portals.push(portal(entry).map_err(|what| invalid(at, format!("portal '{}'{what}", entry.name)))?);
    }
    Ok(portals)
}

fn check_head(document: &serde_json::Value) -> Result<(), String> {
    if document.get("format").and_then(|f| f.as_str()) != Some(SIDECAR_FORMAT) {
        return Err(format!("not a file of portals: its \"format\" is not \"{SIDECAR_FORMAT}\""));
    }
    match document.get("version").and_then(|v| v.as_u64()) {
        Some(version) if version == u64::from(SIDECAR_VERSION) => Ok(()),
        Some(version) => Err(format!("version {version} is not known; there is {SIDECAR_VERSION}")),
        None => Err("its \"version\" is missing or no whole number".into()),
    }
}

fn portal(entry: &Entry) -> Result<Portal, String> {
    let transmission = Vec3::from(entry.transmission);
    if !entry.transmission.iter().all(|t| (0.0..=1.0).contains(t)) {
        return Err(format!(": transmission {transmission} is not from 0 to 1"));
    }
    let mut triangles = Vec::new();
    for (i, polygon) in entry.polygons.iter().enumerate() {
        let corners: Vec<Vec3> = polygon.iter().copied().map(Vec3::from).collect();
        let area = check_polygon(&corners).and_then(|()| cut(&corners, &mut triangles));
        area.map_err(|what| format!(", polygon {}: {what}", i + 1))?;
    }
    Portal::new(&entry.name, triangles, transmission).ok_or_else(|| " has no polygon".into())
}

fn check_polygon(corners: &[Vec3]) -> Result<(), String> {
    if corners.len() < 3 {
        return Err(format!("{} corner(s) are no polygon", corners.len()));
    }
    if let Some(p) = corners.iter().find(|p| p.abs().max_element() > MAX_COORDINATE) {
        return Err(format!("corner {p} is not within {MAX_COORDINATE:e} m"));
    }
    let origin = corners[0].as_dvec3();
    let p: Vec<DVec3> = corners.iter().map(|c| c.as_dvec3() - origin).collect();
    let normal: DVec3 = (0..p.len()).map(|i| p[i].cross(p[(i + 1) % p.len()])).sum();
    let Some(normal) = normal.try_normalize() else { return Err("it has no area".into()) };
    let size = p.iter().map(|q| q.length()).fold(0.0, f64::max);
    match p.iter().map(|q| q.dot(normal).abs()).fold(0.0, f64::max) {
        off if off > FLATNESS * size => {
            Err(format!("it is not flat (a corner lies {off:.3} m off its plane); cut it"))
        }
        _ => Ok(()),
    }
}

fn cut(corners: &[Vec3], triangles: &mut Vec<[Vec3; 3]>) -> Result<(), String> {
    let mut index = Vec::new();
    polygon::triangulate(corners, &mut index);
    let n = triangles.len();
    let solid = |t: &[Vec3; 3]| !crate::repair::is_flat(*t);
    triangles.extend(index.iter().map(|t| t.map(|i| corners[i])).filter(solid));
    if triangles.len() > n { Ok(()) } else { Err("it has no area".into()) }
}

fn invalid(at: &str, what: impl Into<String>) -> Error {
    Error::Invalid { at: at.to_owned(), what: what.into() }
}
