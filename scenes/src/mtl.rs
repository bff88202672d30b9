//! Materials of `.mtl` files, by way of `tobj`.
//!
//! Taken over: `Kd`, `Ks`, `Ns`, `Ke`, and how much light goes straight through:
//!
//! - `illum` 4, 6, 7 or 9 (glass) with a `Tf`: the transmission is `Tf`;
//! - otherwise `1 - d` (or `Tr` where there is no `d`), times `Tf` where that has a colour. A grey `Tf` beside a `d`
//!   is that same `d` once more, as 3ds Max writes it.
//!
//! `illum` 0 and 1 mean no highlight, so `Ks` is 0 there. Textures are not read; all else is passed over.
//!
//! Based on: Ramey, Rose & Tyerman, MTL material format (Lightwave, OBJ), 1995.
//!
//! A lone `Tr 1` is taken for *opaque*: old exporters mean `d` by it, and nobody draws a surface that is not there.

use std::path::{Path, PathBuf};

use glam::Vec3;

use crate::lines::{lines, name, number, words};
use crate::names::{Names, count, some};
use crate::scene::Material;

/// `illum` values in which light passes through the surface.
const GLASS: [u8; 4] = [4, 6, 7, 9];

/// What the libraries of a file hold.
#[derive(Default)]
pub(crate) struct Library {
    pub names: Names,
    /// In the order of `names`.
    pub materials: Vec<Material>,
    pub report: Vec<String>,
}

/// Reads the libraries that `mtllib` lines name, relative to the folder of the `.obj`. What cannot be found or read
/// is reported and does without.
pub(crate) fn load_libraries(folder: &Path, mtllib: &[String]) -> Library {
    let mut library = Library::default();
    let mut seen = Vec::new();
    for text in mtllib {
        let paths = resolve(folder, text);
        if paths.is_empty() {
            library
                .report
                .push(format!("material library '{text}' not found: its materials are grey (Kd 0.5)"));
        }
        for path in paths {
            if !seen.contains(&path) {
                read_library(&path, &mut library);
                seen.push(path);
            }
        }
    }
    library
}

/// The files that an `mtllib` line means: one name with blanks, or several names; where the path leads nowhere, the
/// file of that name beside the `.obj`.
fn resolve(folder: &Path, text: &str) -> Vec<PathBuf> {
    match find(folder, text) {
        Some(path) => vec![path],
        None => text.split_whitespace().filter_map(|word| find(folder, word)).collect(),
    }
}

fn find(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.trim_matches('"').replace('\\', "/");
    let beside = name.rsplit('/').next().unwrap_or(&name);
    [folder.join(&name), folder.join(beside)].into_iter().find(|path| path.is_file())
}

fn read_library(path: &Path, library: &mut Library) {
    match std::fs::read(path) {
        Ok(bytes) => parse(&bytes, &path.display().to_string(), library),
        Err(error) => {
            library.report.push(format!("{}: {error}: its materials are grey (Kd 0.5)", path.display()))
        }
    }
}

/// Adds the materials of one library; a material that is there already is replaced.
pub(crate) fn parse(bytes: &[u8], at: &str, library: &mut Library) {
    let tidy = tidy(bytes);
    let Ok((materials, _)) = tobj::load_mtl_buf(&mut tidy.text.as_bytes()) else {
        library.report.push(format!("{at}: not a material library: its materials are grey (Kd 0.5)"));
        return;
    };
    if let Some(line) = tidy.first_unreadable {
        let n = count(tidy.n_unreadable, "value");
        library.report.push(format!("{n} not understood in {at} left out, the first in line {line}"));
    }
    let mut notes = Notes::default();
    for (source, name) in materials.iter().zip(tidy.names) {
        let material = convert(source, name, &mut notes);
        let index = library.names.index(&material.name) as usize;
        if index < library.materials.len() {
            notes.doubled.push(material.name.clone());
            library.materials[index] = material;
        } else {
            library.materials.push(material);
        }
    }
    notes.report(&mut library.report);
}

/// Lines that `tobj` takes without a panic: `newmtl` with a number for a name, and keywords with as many finite
/// numbers as they need.
#[derive(Default)]
struct Tidy {
    text: String,
    names: Vec<String>,
    n_unreadable: usize,
    first_unreadable: Option<usize>,
}

fn tidy(bytes: &[u8]) -> Tidy {
    let mut tidy = Tidy::default();
    for (number, line) in lines(bytes) {
        let Some(keyword) = words(&line).next() else { continue };
        match canonical(keyword) {
            Some(("newmtl", _)) => {
                tidy.text += &format!("newmtl {}\n", tidy.names.len());
                tidy.names.push(name(&line, keyword));
            }
            Some(("map_Kd", _)) => tidy.text += "map_Kd texture\n",
            Some((known, n)) => match numbers(&line, n) {
                // `tobj` wants a whole number here, and gives up the library otherwise.
                Some(values) if known == "illum" => {
                    tidy.text += &format!("illum {}\n", values.parse::<f32>().unwrap_or(2.0) as u8);
                }
                Some(values) => tidy.text += &format!("{known} {values}\n"),
                None => {
                    tidy.n_unreadable += 1;
                    tidy.first_unreadable.get_or_insert(number);
                }
            },
            None => {}
        }
    }
    tidy
}

/// The keyword as `tobj` wants it, and how many numbers go with it.
fn canonical(keyword: &[u8]) -> Option<(&'static str, usize)> {
    const KNOWN: [(&str, usize); 10] = [
        ("newmtl", 0),
        ("map_Kd", 0),
        ("Kd", 3),
        ("Ks", 3),
        ("Ke", 3),
        ("Tf", 3),
        ("Ns", 1),
        ("d", 1),
        ("Tr", 1),
        ("illum", 1),
    ];
    KNOWN.into_iter().find(|(known, _)| keyword.eq_ignore_ascii_case(known.as_bytes()))
}

/// The `n` numbers of a line; a single one stands for all three channels. Options such as `-halo` are passed over.
fn numbers(line: &[u8], n: usize) -> Option<String> {
    let option = |word: &&[u8]| word[0] == b'-' && word.get(1).is_some_and(u8::is_ascii_alphabetic);
    let values: Vec<f32> = words(line)
        .skip(1)
        .skip_while(option)
        .map_while(number)
        .take_while(|value| value.is_finite())
        .take(n)
        .collect();
    let join = |values: &[f32]| values.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    match values[..] {
        [one] => Some(join(&vec![one; n])),
        _ if values.len() == n => Some(join(&values)),
        _ => None,
    }
}

/// What is worth telling about the materials of a library.
#[derive(Default)]
struct Notes {
    clamped: Vec<String>,
    lossless: Vec<String>,
    textured: Vec<String>,
    uncoloured: Vec<String>,
    doubled: Vec<String>,
    reversed: Vec<String>,
}

impl Notes {
    fn report(&self, report: &mut Vec<String>) {
        let mut tell = |names: &[String], what: &str| {
            if !names.is_empty() {
                report.push(format!("{} {what}: {}", count(names.len(), "material"), some(names)));
            }
        };
        tell(&self.clamped, "with a value outside of 0 to 1 cut to that range");
        tell(&self.lossless, "with Kd 1, where light fades only by leaving the scene");
        tell(&self.textured, "with a texture, which is not read (Kd stands for it)");
        tell(&self.uncoloured, "without Kd made grey (Kd 0.5)");
        tell(&self.doubled, "defined more than once, the last one taken");
        tell(&self.reversed, "with Tr 1 and no d taken as opaque");
    }
}

fn convert(source: &tobj::Material, name: String, notes: &mut Notes) -> Material {
    let colour = |value: Option<[f32; 3]>| value.map(Vec3::from);
    let default = Material::default();
    let albedo = colour(source.diffuse);
    let specular = colour(source.specular).unwrap_or(Vec3::ZERO);
    let illum = parameter(source, "illum").map_or(2, |values| values[0] as u8);
    let material = Material {
        albedo: unit(albedo.unwrap_or(default.albedo)),
        specular: if illum < 2 { Vec3::ZERO } else { unit(specular) },
        exponent: source.shininess.unwrap_or(0.0).max(0.0),
        emission: colour(source.emissive).unwrap_or(Vec3::ZERO).max(Vec3::ZERO),
        transmission: transmission(source, illum, &name, notes),
        name,
    };
    let mut note = |condition: bool, list: fn(&mut Notes) -> &mut Vec<String>| {
        if condition {
            list(notes).push(material.name.clone());
        }
    };
    let emission_cut = colour(source.emissive).is_some_and(|e| e.min_element() < 0.0);
    note(albedo.is_some_and(|a| a != unit(a)) || specular != unit(specular) || emission_cut, |n| {
        &mut n.clamped
    });
    note(albedo.is_some_and(|a| a.max_element() >= 1.0), |n| &mut n.lossless);
    note(source.diffuse_texture.is_some(), |n| &mut n.textured);
    note(albedo.is_none(), |n| &mut n.uncoloured);
    material
}

fn transmission(source: &tobj::Material, illum: u8, name: &str, notes: &mut Notes) -> Vec3 {
    let filter = parameter(source, "Tf").map(|values| unit(Vec3::from_slice(&values)));
    if let Some(filter) = filter.filter(|_| GLASS.contains(&illum)) {
        return filter;
    }
    let through = match (source.dissolve, parameter(source, "Tr").map(|values| values[0])) {
        (Some(d), _) => 1.0 - d,
        (None, Some(1.0)) => {
            notes.reversed.push(name.to_owned());
            0.0
        }
        (None, through) => through.unwrap_or(0.0),
    };
    let tint = filter.filter(|f| f.max_element() > f.min_element()).unwrap_or(Vec3::ONE);
    unit(tint * through)
}

/// Numbers of a keyword that `tobj` keeps as text; as many as `tidy` wrote.
fn parameter(source: &tobj::Material, keyword: &str) -> Option<Vec<f32>> {
    let text = match keyword {
        "illum" => return source.illumination_model.map(|illum| vec![f32::from(illum)]),
        _ => source.unknown_param.get(keyword)?,
    };
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

fn unit(colour: Vec3) -> Vec3 {
    colour.clamp(Vec3::ZERO, Vec3::ONE)
}
