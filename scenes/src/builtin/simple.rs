//! A plane, and one thing on it.

use std::f32::consts::{FRAC_1_SQRT_2, TAU};

use glam::{Vec3, vec2, vec3};

use super::draft::{Draft, Facing, Paint};
use super::shapes::{circle, disc, floor, grid, lathe, perimeter, pieces, round, slope, sphere, spread};
use super::spec::Values;
use crate::Scene;

/// Linear reflectances: a light grey ground, and warm plaster on it.
const GROUND: [f32; 3] = [0.5, 0.5, 0.5];
const OBJECT: [f32; 3] = [0.7, 0.45, 0.3];

/// Rings around a foot lie at distances t^1.4: three times as dense at the foot, where light changes, as outside.
const RING_GROWTH: f32 = 1.4;

pub fn plane(values: &Values) -> Result<Scene, String> {
    let mut draft = Draft::default();
    let ground = draft.matt("ground", GROUND);
    let paint = draft.paint("plane", ground);
    let half = 0.5 * values.get("size");
    let line = spread(-half, half, values.count("n"));
    // By hand, for a plane may be far finer than a welded patch needs to be.
    let points = grid(&line, &line, |x, z| vec3(x, 0.0, z));
    let columns = line.len() as u32;
    let cell = |a: u32| [[a, a + columns, a + columns + 1], [a, a + columns + 1, a + 1]];
    let cells = (0..columns - 1).flat_map(|r| (0..columns - 1).map(move |c| r * columns + c));
    let triangles: Vec<[u32; 3]> = cells.flat_map(cell).collect();
    draft.add(paint, &points.point, &vec![Vec3::Y; points.point.len()], &triangles);
    Ok(draft.scene)
}

pub fn sphere_on_plane(values: &Values) -> Result<Scene, String> {
    let [radius, size, edge] = ["radius", "size", "edge"].map(|name| values.get(name));
    let mut draft = Draft::default();
    let (ground, object) = (draft.matt("ground", GROUND), draft.matt("sphere", OBJECT));
    // An odd number of squares keeps vertices off the point of contact, where nothing is visible.
    let line = spread(-0.5 * size, 0.5 * size, pieces(size, edge) | 1);
    let paint = draft.paint("plane", ground);
    floor(&mut draft, paint, &line, 0.0, &line);
    let paint = draft.paint("sphere", object);
    sphere(&mut draft, paint, radius * Vec3::Y, radius, edge);
    Ok(draft.scene)
}

pub fn cylinder_on_plane(values: &Values) -> Result<Scene, String> {
    let [radius, height, size, edge] = ["radius", "height", "size", "edge"].map(|name| values.get(name));
    if 2.0 * radius >= 0.98 * size {
        return Err(format!("a cylinder of radius {radius} m does not fit on a square of side {size} m"));
    }
    let mut draft = Draft::default();
    let (ground, object) = (draft.matt("ground", GROUND), draft.matt("cylinder", OBJECT));
    // The square is cut around the foot, in rings that are narrower near it.
    let line = spread(-0.5 * size, 0.5 * size, pieces(size, edge).max(8));
    let border = perimeter(&line, &line);
    let angles: Vec<f32> = border.iter().map(|p| p.y.atan2(p.x)).collect();
    let n = pieces(RING_GROWTH * (size * FRAC_1_SQRT_2 - radius), edge);
    let place = |i: f32, t: f32| {
        let i = i as usize;
        circle(Vec3::ZERO, radius, &angles[i..=i])[0].lerp(vec3(border[i].x, 0.0, border[i].y), t)
    };
    let steps: Vec<f32> = spread(0.0, 1.0, n).iter().map(|t| t.powf(RING_GROWTH)).collect();
    let numbers: Vec<f32> = (0..angles.len()).map(|i| i as f32).collect();
    let rings = grid(&numbers, &steps, place);
    let paint = draft.paint("plane", ground);
    draft.patch(paint, &rings, Facing::Along(Vec3::Y));
    let paint = draft.paint("cylinder", object);
    let wall = slope(vec2(radius, 0.0), vec2(radius, height), edge);
    lathe(&mut draft, paint, Vec3::ZERO, &wall, &angles);
    disc(&mut draft, paint, height * Vec3::Y, [0.0, radius], &angles, edge, Vec3::Y);
    Ok(draft.scene)
}

pub fn horizon_band(values: &Values) -> Result<Scene, String> {
    let [radius, height, size, edge] = ["radius", "height", "size", "edge"].map(|name| values.get(name));
    let mut draft = Draft::default();
    let (ground, object) = (draft.matt("ground", GROUND), draft.matt("canopy", OBJECT));
    let line = spread(-0.5 * size, 0.5 * size, pieces(size, edge));
    let paint = draft.paint("floor", ground);
    floor(&mut draft, paint, &line, 0.0, &line);
    // A twentieth of its radius thick, on nothing.
    let paint = draft.paint("canopy", object);
    let angles = round(pieces(TAU * radius, edge).max(24));
    disc(&mut draft, paint, height * Vec3::Y, [0.0, radius], &angles, edge, -Vec3::Y);
    canopy_top(&mut draft, paint, height, radius, &angles, edge);
    Ok(draft.scene)
}

fn canopy_top(draft: &mut Draft, paint: Paint, height: f32, radius: f32, angles: &[f32], edge: f32) {
    let foot = height * Vec3::Y;
    let thickness = 0.05 * radius;
    lathe(draft, paint, foot, &slope(vec2(radius, 0.0), vec2(radius, thickness), edge), angles);
    disc(draft, paint, foot + thickness * Vec3::Y, [0.0, radius], angles, edge, Vec3::Y);
}
