//! Wavefront `.obj` meshes, by way of `tobj`.
//!
//! Positions, normals, faces of any number of corners, `o`/`g` names and materials are taken over; texture
//! coordinates, smoothing groups, lines, points and free-form surfaces are not. An object or group name holds until
//! the next of either kind.
//!
//! Based on: Wavefront Technologies, Advanced Visualizer Manual, appendix B1, Object Files.

use std::path::Path;

use glam::Vec3;

use crate::names::{count, some};
use crate::open::{DEFAULT, LoadOptions};
use crate::polygon::triangulate;
use crate::repair::{Soup, finish};
use crate::scene::{Error, Material, Scene};
use crate::tidy::{Tidy, part_of, tidy, vertex_of};
use crate::{mtl, open};

/// Loads a `.obj` file and the material libraries that it names.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, Error> {
    let bytes = open::read(path)?;
    let at = path.display().to_string();
    if bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") {
        return Err(Error::Invalid { at, what: "the text is UTF-16; save it as UTF-8 or ASCII".into() });
    }
    let mut tidy = tidy(&bytes);
    let models = read_models(&mut tidy, &at)?;
    let library = mtl::load_libraries(path.parent().unwrap_or(Path::new("")), &tidy.libraries);

    let mut scene = Scene { report: library.report, materials: library.materials, ..Scene::default() };
    let material_of = match_materials(&tidy, &library.names, &mut scene);
    tell_left_out(&tidy, &mut scene.report);
    let soup = gather(&models, &mut tidy, &material_of, &mut scene);
    scene.groups = std::mem::take(&mut tidy.groups.list);
    finish(soup, scene, options, &at)
}

fn read_models(tidy: &mut Tidy, at: &str) -> Result<Vec<tobj::Model>, Error> {
    let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let loaded = tobj::load_obj_buf(tidy, &options, |_| Err(tobj::LoadError::OpenFileFailed));
    let fault = tidy.fault.take();
    let invalid = |line: usize, what: String| Err(Error::Invalid { at: format!("{at}:{line}"), what });
    match (fault, loaded) {
        (Some(fault), _) => invalid(fault.line, fault.what),
        (None, Err(error)) => invalid(tidy.line, error.to_string()),
        (None, Ok(_)) if tidy.n_faces == 0 => Err(Error::Invalid {
            at: at.to_owned(),
            what: format!(
                "no triangle: the file has {} and no face; is it a Wavefront .obj mesh?",
                count(tidy.n_vertices as usize, "vertex")
            ),
        }),
        (None, Ok((models, _))) => Ok(models),
    }
}

/// Material of each name after `usemtl`; names that no library has become grey materials.
fn match_materials(tidy: &Tidy, known: &crate::names::Names, scene: &mut Scene) -> Vec<u32> {
    let mut unknown = Vec::new();
    let list = tidy.materials.list.iter().map(|name| {
        known.find(name).unwrap_or_else(|| {
            unknown.push(name.clone());
            scene.materials.push(Material { name: name.clone(), ..Material::default() });
            scene.materials.len() as u32 - 1
        })
    });
    let list = list.collect();
    if !unknown.is_empty() {
        let n = count(unknown.len(), "material");
        scene.report.push(format!("{n} not in any material library made grey (Kd 0.5): {}", some(&unknown)));
    }
    list
}

fn tell_left_out(tidy: &Tidy, report: &mut Vec<String>) {
    if tidy.n_loose > 0 {
        report.push(format!("{} left out: only faces are lit", count(tidy.n_loose, "line or point element")));
    }
    if tidy.n_curved > 0 {
        report.push(format!(
            "{} left out: only faces are read",
            count(tidy.n_curved, "free-form curve or surface")
        ));
    }
}

/// Puts the pieces that `tobj` made together again, with the numbers that the vertices have in the file.
fn gather(models: &[tobj::Model], tidy: &mut Tidy, material_of: &[u32], scene: &mut Scene) -> Soup {
    let mut soup = Soup { position: vec![Vec3::ZERO; tidy.n_vertices as usize], ..Soup::default() };
    let mut default_material = None;
    let mut n_uncoloured = 0;
    for model in models.iter().filter(|model| !model.mesh.indices.is_empty()) {
        let (group, material) = part_of(&model.name);
        let group = group.unwrap_or_else(|| tidy.groups.index(DEFAULT));
        let start = soup.triangle.len();
        add_model(&model.mesh, &mut soup);
        let added = soup.triangle.len() - start;
        let material = material.map_or_else(
            || {
                n_uncoloured += added;
                *default_material.get_or_insert(scene.materials.len() as u32)
            },
            |id| material_of[id as usize],
        );
        soup.material.resize(soup.triangle.len(), material);
        soup.group.resize(soup.triangle.len(), group);
    }
    if default_material.is_some() {
        scene.materials.push(Material { name: DEFAULT.into(), ..Material::default() });
        scene
            .report
            .push(format!("{} without a material made grey (Kd 0.5)", count(n_uncoloured, "triangle")));
    }
    soup
}

fn add_model(mesh: &tobj::Mesh, soup: &mut Soup) {
    let at = |values: &[f32], i: u32| Vec3::from_slice(&values[3 * i as usize..]);
    let n_local = mesh.positions.len() / 3;
    let number: Vec<u32> = (0..n_local).map(|i| vertex_of(&mesh.vertex_color[3 * i..])).collect();
    for (i, &vertex) in number.iter().enumerate() {
        soup.position[vertex as usize] = at(&mesh.positions, i as u32);
    }
    let normal = |i: u32| if mesh.normals.is_empty() { Vec3::ZERO } else { at(&mesh.normals, i) };

    let (mut start, mut corner, mut triangles) = (0, Vec::new(), Vec::new());
    let n_faces = if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { mesh.face_arities.len() };
    for face in 0..n_faces {
        let arity = mesh.face_arities.get(face).map_or(3, |&n| n as usize);
        let ring = &mesh.indices[start..start + arity];
        start += arity;
        corner.clear();
        corner.extend(ring.iter().map(|&i| at(&mesh.positions, i)));
        triangulate(&corner, &mut triangles);
        for triangle in &triangles {
            soup.triangle.push(triangle.map(|k| number[ring[k] as usize]));
            soup.normal.push(triangle.map(|k| normal(ring[k])));
        }
    }
}
