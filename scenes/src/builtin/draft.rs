//! Putting a scene together patch by patch.
//!
//! A patch is a rectangular array of points, which becomes triangles with smooth normals of its own: two patches
//! never share a vertex, so that every border between patches is a crease, as a bake per vertex needs it. Inside
//! a patch, points that coincide (the seam of a cylinder, the pole of a dome) are one vertex.

use std::collections::HashMap;

use glam::Vec3;

use crate::{Material, Scene};

/// Points closer than this, in metres, are one vertex of a patch: far below any tessellation, far above rounding.
const WELD: f32 = 1e-5;

/// Twice the area, in m², below which a triangle is dropped: the collapsed ones at poles and at arch springings.
const NO_AREA: f32 = 1e-10;

/// Which material and which group a surface belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Paint {
    /// Index of the material.
    pub material: u32,
    /// Index of the group.
    pub group: u32,
}

/// Which of a patch's two sides is seen.
#[derive(Clone, Copy, Debug)]
pub enum Facing {
    /// The one that this direction points out of.
    Along(Vec3),
    /// The one turned away from this point.
    From(Vec3),
    /// The one turned to this point.
    Towards(Vec3),
}

/// Points of a patch, row by row.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Points in a row.
    pub columns: usize,
    /// All points, a whole number of rows.
    pub point: Vec<Vec3>,
}

/// A scene being built.
#[derive(Debug, Default)]
pub struct Draft {
    /// What has been built so far.
    pub scene: Scene,
}

impl Draft {
    /// An opaque diffuse material of the given linear reflectance.
    pub fn matt(&mut self, name: &str, albedo: [f32; 3]) -> u32 {
        self.material(Material { name: name.into(), albedo: albedo.into(), ..Material::default() })
    }

    /// Clear or tinted glass that lets `transmission` straight through and reflects nothing.
    pub fn glass(&mut self, name: &str, transmission: [f32; 3]) -> u32 {
        let transmission = transmission.into();
        self.material(Material { name: name.into(), albedo: Vec3::ZERO, transmission, ..Material::default() })
    }

    fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    /// The group of that name, made where it is not there yet, painted with a material.
    pub fn paint(&mut self, group: &str, material: u32) -> Paint {
        let groups = &mut self.scene.groups;
        let known = groups.iter().position(|name| name == group);
        let group = known.unwrap_or_else(|| {
            groups.push(group.into());
            groups.len() - 1
        });
        Paint { material, group: group as u32 }
    }

    /// Adds a patch whose normals are the mean of its own faces', weighted by their areas.
    pub fn patch(&mut self, paint: Paint, grid: &Grid, facing: Facing) {
        let (slot, position) = weld(&grid.point);
        let mut triangles = triangulate(grid, &slot, &position);
        if turned_away(&triangles, &position, facing) {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let normal = mean_normals(&triangles, &position);
        self.add(paint, &position, &normal, &triangles);
    }

    /// Adds a patch whose normals are known: `normal` of each vertex's position.
    pub fn smooth_patch(&mut self, paint: Paint, grid: &Grid, normal: impl Fn(Vec3) -> Vec3) {
        let (slot, position) = weld(&grid.point);
        let mut triangles = triangulate(grid, &slot, &position);
        let normal: Vec<Vec3> = position.iter().map(|&p| normal(p)).collect();
        for t in &mut triangles {
            if area_vector(t, &position).dot(normal[t[0] as usize]) < 0.0 {
                t.swap(1, 2);
            }
        }
        self.add(paint, &position, &normal, &triangles);
    }

    /// Adds triangles as they are; indices count from the first of these vertices.
    pub fn add(&mut self, paint: Paint, position: &[Vec3], normal: &[Vec3], triangles: &[[u32; 3]]) {
        let mesh = &mut self.scene.mesh;
        let first = mesh.position.len() as u32;
        mesh.position.extend_from_slice(position);
        mesh.normal.extend_from_slice(normal);
        mesh.index.extend(triangles.iter().map(|t| t.map(|v| v + first)));
        mesh.material.resize(mesh.index.len(), paint.material);
        mesh.group.resize(mesh.index.len(), paint.group);
    }
}

/// Area-weighted mean of the normals of the faces around each vertex.
pub fn mean_normals(triangles: &[[u32; 3]], position: &[Vec3]) -> Vec<Vec3> {
    let mut normal = vec![Vec3::ZERO; position.len()];
    for t in triangles {
        let area = area_vector(t, position);
        t.iter().for_each(|&v| normal[v as usize] += area);
    }
    normal.iter().map(|n| n.normalize_or(Vec3::Y)).collect()
}

/// Twice the area, m², along the normal.
pub fn area_vector(t: &[u32; 3], position: &[Vec3]) -> Vec3 {
    let [a, b, c] = t.map(|v| position[v as usize]);
    (b - a).cross(c - a)
}

/// Whether a triangle is worth keeping.
pub fn has_area(t: &[u32; 3], position: &[Vec3]) -> bool {
    area_vector(t, position).length() > NO_AREA
}

/// The distinct points, and which of them each given point is.
fn weld(point: &[Vec3]) -> (Vec<u32>, Vec<Vec3>) {
    let mut known = HashMap::with_capacity(point.len());
    let mut position = Vec::with_capacity(point.len());
    let slot = point
        .iter()
        .map(|&p| {
            let key = (p / WELD).round().to_array().map(|x| x as i64);
            *known.entry(key).or_insert_with(|| {
                position.push(p);
                position.len() as u32 - 1
            })
        })
        .collect();
    (slot, position)
}

/// Two triangles for each cell, along the shorter diagonal.
fn triangulate(grid: &Grid, slot: &[u32], position: &[Vec3]) -> Vec<[u32; 3]> {
    let (columns, rows) = (grid.columns, grid.point.len() / grid.columns.max(1));
    let mut triangles = Vec::with_capacity(2 * columns * rows);
    for r in 1..rows {
        for c in 1..columns {
            let at = r * columns + c;
            let [p, q, s, t] = [at - columns - 1, at - columns, at, at - 1].map(|i| slot[i]);
            triangles.extend(split([p, q, s, t], position));
        }
    }
    triangles.retain(|t| has_area(t, position));
    triangles
}

/// The quadrilateral `p q s t` as two triangles along its shorter diagonal, `p s` where they are alike; or along the
/// longer one where the other lies outside.
pub fn split([p, q, s, t]: [u32; 4], position: &[Vec3]) -> [[u32; 3]; 2] {
    let length = |a: u32, b: u32| position[a as usize].distance(position[b as usize]);
    let (along, across) = ([[p, q, s], [p, s, t]], [[p, q, t], [q, s, t]]);
    // A thousandth keeps rounding from choosing.
    let (first, second) = if length(q, t) < 0.999 * length(p, s) { (across, along) } else { (along, across) };
    let folded = area_vector(&first[0], position).dot(area_vector(&first[1], position)) < 0.0;
    if folded { second } else { first }
}

fn turned_away(triangles: &[[u32; 3]], position: &[Vec3], facing: Facing) -> bool {
    let agreement = |t: &[u32; 3]| {
        let centre = t.iter().map(|&v| position[v as usize]).sum::<Vec3>() / 3.0;
        let wanted = match facing {
            Facing::Along(direction) => direction,
            Facing::From(point) => centre - point,
            Facing::Towards(point) => point - centre,
        };
        area_vector(t, position).dot(wanted)
    };
    triangles.iter().map(agreement).sum::<f32>() < 0.0
}
