//! Scenes written as `.obj` with an `.mtl` beside it.
//!
//! Numbers are written with as many digits as it takes to read the same f32 back. Transmission is written as `Tf`
//! with `illum 4`, and as `d` for programs that know only that.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use glam::Vec3;

use crate::scene::{Error, Material, Mesh, Scene};

/// Writes `scene` to `path`, and its materials beside it with the ending `.mtl`. Each file is there whole or not at
/// all. Names of materials and groups lose what the format cannot hold (line ends; blanks, `#` and `\` at the ends), and
/// get a number if they are empty or doubled.
///
/// # Errors
/// [`Error::Io`] if a file cannot be written.
pub fn write_obj(scene: &Scene, path: &Path) -> Result<(), Error> {
    let materials = unique_names(scene.materials.iter().map(|material| material.name.as_str()), "material");
    let groups = unique_names(scene.groups.iter().map(String::as_str), "group");
    let library = path.with_extension("mtl");
    let library_name = library.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let library_is_new = !library.exists();
    write_whole(&library, |out| write_materials(out, scene, &materials))?;
    let written = write_whole(path, |out| {
        writeln!(out, "mtllib {library_name}")?;
        write_mesh(out, &scene.mesh, &materials, &groups)
    });
    if written.is_err() && library_is_new {
        // Materials alone are of no use; the first error is the one to tell.
        let _ = std::fs::remove_file(&library);
    }
    written
}

/// Writes to a file beside `path`, which takes its place once all of it is on the disk.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Error> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.partial", std::process::id()));
    let partial = path.with_file_name(name);
    let written = write_and_sync(&partial, write).and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|source| {
        // Nothing is to be left behind; if it cannot be removed, the first error is the one to tell.
        let _ = std::fs::remove_file(&partial);
        Error::Io { path: PathBuf::from(path), source }
    })
}

fn write_and_sync(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    write(&mut out)?;
    out.into_inner()?.sync_all()
}

fn write_materials(out: &mut impl Write, scene: &Scene, names: &[String]) -> io::Result<()> {
    for (material, name) in scene.materials.iter().zip(names) {
        write_material(out, material, name)?;
    }
    Ok(())
}

fn write_material(out: &mut impl Write, material: &Material, name: &str) -> io::Result<()> {
    writeln!(out, "newmtl {name}")?;
    writeln!(out, "Kd {}", spaced(material.albedo))?;
    writeln!(out, "Ks {}", spaced(material.specular))?;
    writeln!(out, "Ns {}", material.exponent)?;
    writeln!(out, "Ke {}", spaced(material.emission))?;
    if material.transmission == Vec3::ZERO {
        return writeln!(out, "illum 2\n");
    }
    writeln!(out, "Tf {}", spaced(material.transmission))?;
    writeln!(out, "d {}", 1.0 - material.transmission.max_element())?;
    writeln!(out, "illum 4\n")
}

fn write_mesh(out: &mut impl Write, mesh: &Mesh, materials: &[String], groups: &[String]) -> io::Result<()> {
    for &p in &mesh.position {
        writeln!(out, "v {}", spaced(p))?;
    }
    for &n in &mesh.normal {
        writeln!(out, "vn {}", spaced(n))?;
    }
    // All groups once, so that they keep their order.
    for name in groups {
        writeln!(out, "g {name}")?;
    }
    let mut last = (None, None);
    for ((triangle, &material), &group) in mesh.index.iter().zip(&mesh.material).zip(&mesh.group) {
        if last.0.replace(group) != Some(group) {
            writeln!(out, "g {}", groups[group as usize])?;
        }
        if last.1.replace(material) != Some(material) {
            writeln!(out, "usemtl {}", materials[material as usize])?;
        }
        let [a, b, c] = triangle.map(|v| v + 1);
        writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
    }
    Ok(())
}

fn spaced(v: Vec3) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}

fn unique_names<'a>(names: impl Iterator<Item = &'a str>, kind: &str) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut list = Vec::new();
    for name in names {
        let plain = name.replace(|c: char| c.is_control(), " ").replace(" # ", " ");
        let plain = plain.trim_matches(|c: char| c.is_whitespace() || c == '#' || c == '\\');
        let stem = if plain.is_empty() { kind } else { plain };
        let numbered = (2..).map(|n| format!("{stem} {n}"));
        let free = std::iter::once(stem.to_owned()).chain(numbered).find(|name| !taken.contains(name));
        list.extend(free.inspect(|name| {
            taken.insert(name.clone());
        }));
    }
    list
}
