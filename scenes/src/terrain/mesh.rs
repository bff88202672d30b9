//! From a grid of heights to a mesh.

use glam::{Vec3, vec3};

use super::{Heights, voids};
use crate::{Material, Mesh, Scene};

/// Linear reflectance of bare ground.
const GROUND: Vec3 = vec3(0.34, 0.31, 0.26);

/// Fills the voids and makes a mesh of two triangles a cell, all cut from north-west to south-east.
///
/// A vertex's normal is that of the surface through its neighbours, n ~ (-dh/dx, 1, -dh/dz) by central
/// differences (one-sided at the border).
///
/// # Errors
/// A sentence, if there is no height at all.
pub fn heights_to_scene(mut heights: Heights) -> Result<Scene, String> {
    let (columns, rows) = (heights.columns, heights.rows);
    let Some(filled) = voids::fill(columns, rows, &mut heights.height) else {
        return Err(format!("all of its {columns} x {rows} heights are void: there is nothing to light"));
    };
    let posts = heights.height.len();
    let mut report = std::mem::take(&mut heights.notes);
    if filled.voids > 0 {
        let share = 100.0 * filled.voids as f64 / posts as f64;
        report.push(format!(
            "{} of {posts} heights ({share:.2} %) were void and are filled from those around; {} of them at the border",
            filled.voids, filled.at_border
        ));
    }
    Ok(Scene {
        mesh: mesh(&heights),
        materials: vec![Material { name: "ground".into(), albedo: GROUND, ..Material::default() }],
        groups: vec!["terrain".into()],
        report,
    })
}

fn mesh(grid: &Heights) -> Mesh {
    let (columns, rows) = (grid.columns, grid.rows);
    let middle = |n: usize| 0.5 * (n - 1) as f32;
    let mut mesh = Mesh::default();
    mesh.position.reserve_exact(columns * rows);
    mesh.normal.reserve_exact(columns * rows);
    for r in 0..rows {
        let z = (r as f32 - middle(rows)) * grid.spacing_z;
        for c in 0..columns {
            let x = (c as f32 - middle(columns)) * grid.spacing_x;
            mesh.position.push(vec3(x, grid.height[r * columns + c], z));
            mesh.normal.push(normal(grid, c, r));
        }
    }
    let cells = (columns - 1) * (rows - 1);
    mesh.index.reserve_exact(2 * cells);
    for r in 0..rows - 1 {
        for c in 0..columns - 1 {
            let nw = (r * columns + c) as u32;
            let (ne, sw, se) = (nw + 1, nw + columns as u32, nw + columns as u32 + 1);
            mesh.index.extend([[nw, sw, se], [nw, se, ne]]);
        }
    }
    mesh.material = vec![0; 2 * cells];
    mesh.group = vec![0; 2 * cells];
    mesh
}

fn normal(grid: &Heights, c: usize, r: usize) -> Vec3 {
    let around = |i: usize, n: usize| (i.saturating_sub(1), (i + 1).min(n - 1));
    let ((west, east), (north, south)) = (around(c, grid.columns), around(r, grid.rows));
    let at = |c: usize, r: usize| grid.height[r * grid.columns + c];
    let dx = (at(east, r) - at(west, r)) / ((east - west) as f32 * grid.spacing_x);
    let dz = (at(c, south) - at(c, north)) / ((south - north) as f32 * grid.spacing_z);
    vec3(-dx, 1.0, -dz).normalize()
}
