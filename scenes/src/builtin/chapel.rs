//! A small church: nave with a barrel vault, two aisles behind arcades, and a round apse with a half dome.
//!
//! Walls are 0.6 m and more thick; all openings hold panes, seen from inside. The altar is at -z, the rose at +z.

use std::f32::consts::PI;

use glam::{Vec3, vec2, vec3};

use super::draft::{Draft, Facing, Paint};
use super::shapes::{Wall, arch, column, grid, half_disc, round_hole, round_pane, spread, vault};
use super::solid::{Fill, Lines, Solid};
use super::spec::Values;
use crate::Scene;

/// Half width of the nave inside, m; the arcade's thickness; the outer side of the aisles; the outer walls.
const NAVE: f32 = 3.2;
const ARCADE: f32 = 0.7;
const AISLE: f32 = 6.5;
const OUTER: f32 = 0.6;
/// From column to column, m.
const BAY: f32 = 4.0;
/// Springing of the arcade, and top of the wall over its arches, m.
const ARCADE_SPRING: f32 = 3.6;
const ARCADE_TOP: f32 = 5.5;
/// Height of plinths and of the slabs on the capitals, m.
const SLAB: f32 = 0.25;
/// Ceiling and roof of the aisles, springing of the vault, top of its box, roof, m.
const AISLE_CEILING: f32 = 6.2;
const AISLE_ROOF: f32 = 6.6;
const VAULT_SPRING: f32 = 9.4;
const VAULT_TOP: f32 = 12.9;
const ROOF: f32 = 13.3;
/// Half width, springing and top of the arch to the apse, m.
const CHANCEL: [f32; 3] = [2.5, 5.0, 7.7];
/// Radius of the apse inside and out, m. A little more than the arch's, whose own edge so hides the dome's.
const APSE: [f32; 2] = [2.55, 3.1];
/// Sill and head of the apse's windows, and half their width, m.
const EAST_WINDOW: [f32; 3] = [1.5, 4.2, 0.45];
/// Height of the rose's middle, its radius and half the square around it, m.
const ROSE: [f32; 3] = [7.2, 1.35, 1.55];
/// Stone left above an arched window's crown, m.
const LINTEL: f32 = 0.15;

/// An arched window in a side wall.
struct Window {
    /// Inner and outer side of the wall on the side of +x, m.
    wall: [f32; 2],
    /// Half its width, m.
    half: f32,
    /// Sill and springing, m.
    height: [f32; 2],
}

const WINDOWS: [Window; 2] = [
    Window { wall: [AISLE, AISLE + OUTER], half: 0.6, height: [1.6, 4.2] },
    Window { wall: [NAVE, NAVE + ARCADE], half: 0.55, height: [7.0, 8.1] },
];

impl Window {
    fn top(&self) -> f32 {
        self.height[1] + self.half + LINTEL
    }
}

/// Paints of the chapel.
struct Paints {
    walls: Paint,
    arcade: Paint,
    glass: Paint,
    rose: Paint,
    east: Paint,
}

pub fn chapel(values: &Values) -> Result<Scene, String> {
    let bays = values.count("bays");
    let edge = values.get("edge");
    let half = 0.5 * BAY * bays as f32;
    let mut draft = Draft::default();
    let mut solid = Solid::default();
    let paints = shell(&mut draft, &mut solid, half);
    open_sides(&mut solid, &paints, half, bays);
    open_ends(&mut solid, half);
    furnish(&mut draft, &mut solid, half);
    let lines = solid.lines(edge);
    solid.skin(&mut draft, &lines, |p| p);
    round_sides(&mut draft, &lines, &paints, half, bays, edge);
    round_ends(&mut draft, &lines, &paints, half, edge);
    apse(&mut draft, &paints, -half - OUTER, edge);
    Ok(draft.scene)
}

/// Floor, walls and roofs, hollow.
fn shell(draft: &mut Draft, solid: &mut Solid, half: f32) -> Paints {
    let [floor, plaster, stone] = [
        draft.matt("floor", [0.36, 0.30, 0.25]),
        draft.matt("plaster", [0.72, 0.68, 0.60]),
        draft.matt("stone", [0.55, 0.49, 0.40]),
    ];
    let [clear, rose, east] = [
        draft.glass("glass", [0.85, 0.85, 0.85]),
        draft.glass("glass_rose", [0.75, 0.28, 0.18]),
        draft.glass("glass_east", [0.25, 0.42, 0.75]),
    ];
    let ground = draft.paint("floor", floor);
    let walls = draft.paint("walls", plaster);
    let outer = AISLE + OUTER;
    let end = half + OUTER;
    solid.add(vec3(-outer - 1.0, -0.5, -end - APSE[1] - 1.0), vec3(outer + 1.0, 0.0, end + 1.0), ground);
    solid.add(vec3(-outer, 0.0, -end), vec3(outer, AISLE_ROOF, end), walls);
    let nave = NAVE + ARCADE;
    solid.add(vec3(-nave, AISLE_ROOF, -end), vec3(nave, ROOF, end), walls);
    solid.carve(vec3(-AISLE, 0.0, -half), vec3(AISLE, AISLE_CEILING, half));
    let arcade = draft.paint("arcade", stone);
    for side in [-1.0, 1.0] {
        solid.add(vec3(side * NAVE, 0.0, -half), vec3(side * nave, AISLE_CEILING, half), arcade);
    }
    solid.carve(vec3(-NAVE, 0.0, -half), vec3(NAVE, VAULT_SPRING, half));
    solid.fill(vec3(-NAVE, VAULT_SPRING, -half), vec3(NAVE, VAULT_TOP, half), Fill::Hidden);
    Paints {
        walls,
        arcade,
        glass: draft.paint("windows", clear),
        rose: draft.paint("rose", rose),
        east: draft.paint("east window", east),
    }
}

/// Both ends of a bay's arch.
fn span(half: f32, i: usize) -> [f32; 2] {
    let start = -half + BAY * i as f32;
    [start + 0.5 * ARCADE, start + BAY - 0.5 * ARCADE]
}

/// Arches, columns and windows of both sides.
fn open_sides(solid: &mut Solid, paints: &Paints, half: f32, bays: usize) {
    for side in [-1.0, 1.0] {
        let [a, b] = [side * NAVE, side * (NAVE + ARCADE)];
        // Six squares a plinth give a column of twenty-four sides.
        solid.divide(0, a, b, 6);
        for i in 0..bays {
            let [from, to] = span(half, i);
            solid.carve(vec3(a, 0.0, from), vec3(b, ARCADE_SPRING, to));
            solid.fill(vec3(a, ARCADE_SPRING, from), vec3(b, ARCADE_TOP, to), Fill::Hidden);
            for window in &WINDOWS {
                open_window(solid, paints, window, side, 0.5 * (from + to));
            }
        }
        for i in 1..bays {
            let z = -half + BAY * i as f32;
            let (lo, hi) = (z - 0.5 * ARCADE, z + 0.5 * ARCADE);
            solid.fill(vec3(a, SLAB, lo), vec3(b, ARCADE_SPRING - SLAB, hi), Fill::Hidden);
            solid.divide(2, lo, hi, 6);
        }
    }
}

fn open_window(solid: &mut Solid, paints: &Paints, window: &Window, side: f32, z: f32) {
    let [a, b] = window.wall.map(|x| side * x);
    let [sill, spring] = window.height;
    let (lo, hi) = (z - window.half, z + window.half);
    solid.carve(vec3(a, sill, lo), vec3(b, spring, hi));
    solid.fill(vec3(a, spring, lo), vec3(b, window.top(), hi), Fill::Hidden);
    let middle = 0.5 * (a + b);
    solid.sheet(vec3(middle, sill, lo), vec3(middle, spring, hi), -side * Vec3::X, paints.glass);
    // The pane meets the reveal on a line; the arch gets eight pieces and more.
    solid.divide(0, a, b, 2);
    solid.divide(2, lo, hi, 4);
    solid.divide(1, spring, window.top(), 3);
}

/// The arch to the apse, and the rose.
fn open_ends(solid: &mut Solid, half: f32) {
    let [wide, spring, top] = CHANCEL;
    solid.carve(vec3(-wide, 0.0, -half - OUTER), vec3(wide, spring, -half));
    solid.fill(vec3(-wide, spring, -half - OUTER), vec3(wide, top, -half), Fill::Hidden);
    let [y, _, square] = ROSE;
    solid.fill(vec3(-square, y - square, half), vec3(square, y + square, half + OUTER), Fill::Hidden);
    solid.divide(0, -square, square, 8);
    solid.divide(1, y - square, y + square, 8);
}

/// An altar on two steps, pews, and a door of wood in the west wall.
fn furnish(draft: &mut Draft, solid: &mut Solid, half: f32) {
    let wood = draft.matt("wood", [0.22, 0.12, 0.06]);
    let marble = draft.matt("marble", [0.78, 0.76, 0.72]);
    let (pews, altar) = (draft.paint("pews", wood), draft.paint("altar", marble));
    let door = draft.paint("door", wood);
    solid.add(vec3(-NAVE, 0.0, -half), vec3(NAVE, 0.15, -half + 2.5), altar);
    solid.add(vec3(-1.1, 0.15, -half + 0.6), vec3(1.1, 1.1, -half + 1.3), altar);
    solid.add(vec3(-1.1, 0.0, half), vec3(1.1, 2.8, half + OUTER), door);
    solid.carve(vec3(-1.1, 0.0, half), vec3(1.1, 2.8, half + 0.5 * OUTER));
    let rows = ((2.0 * half - 7.0) / 1.2).max(0.0) as usize;
    for i in 0..rows {
        let z = -half + 4.0 + 1.2 * i as f32;
        for (a, b) in [(-2.7, -0.6), (0.6, 2.7)] {
            solid.add(vec3(a, 0.0, z), vec3(b, 0.45, z + 0.4), pews);
            solid.add(vec3(a, 0.45, z + 0.3), vec3(b, 0.9, z + 0.4), pews);
        }
    }
}

/// What the sides' solid leaves open: arches, columns, and the heads of the windows.
fn round_sides(draft: &mut Draft, lines: &Lines, paints: &Paints, half: f32, bays: usize, edge: f32) {
    let place = |z: f32, y: f32, x: f32| vec3(x, y, z);
    let wall = |x: [f32; 2], y: [f32; 2], z: [f32; 2]| Wall {
        along: lines.between(2, z[0], z[1]),
        up: lines.between(1, y[0], y[1]),
        through: lines.between(0, x[0].min(x[1]), x[0].max(x[1])),
        place: &place,
    };
    for side in [-1.0, 1.0] {
        let thick = [side * NAVE, side * (NAVE + ARCADE)];
        for i in 0..bays {
            let [from, to] = span(half, i);
            arch(draft, paints.arcade, &wall(thick, [ARCADE_SPRING, ARCADE_TOP], [from, to]), edge);
            let middle = 0.5 * (from + to);
            for window in &WINDOWS {
                let x = window.wall.map(|x| side * x);
                let z = [middle - window.half, middle + window.half];
                let head = wall(x, [window.height[1], window.top()], z);
                arch(draft, paints.walls, &head, edge);
                half_disc(draft, paints.glass, &head, 0.5 * (x[0] + x[1]), edge, -side * Vec3::X);
            }
        }
        for i in 1..bays {
            let z = -half + BAY * i as f32;
            let x = lines.between(0, thick[0].min(thick[1]), thick[0].max(thick[1]));
            let z = lines.between(2, z - 0.5 * ARCADE, z + 0.5 * ARCADE);
            column(draft, paints.arcade, [&x, &z], [SLAB, ARCADE_SPRING - SLAB], 0.26, edge);
        }
    }
}

/// The vault with its end walls, the arch to the apse, and the rose.
fn round_ends(draft: &mut Draft, lines: &Lines, paints: &Paints, half: f32, edge: f32) {
    let place = |x: f32, y: f32, z: f32| vec3(x, y, z);
    let wall = |wide: f32, y: [f32; 2], z: [f32; 2]| Wall {
        along: lines.between(0, -wide, wide),
        up: lines.between(1, y[0], y[1]),
        through: lines.between(2, z[0], z[1]),
        place: &place,
    };
    let nave = wall(NAVE, [VAULT_SPRING, VAULT_TOP], [-half, half]);
    vault(draft, paints.walls, &nave);
    half_disc(draft, paints.walls, &nave, -half, edge, Vec3::Z);
    half_disc(draft, paints.walls, &nave, half, edge, -Vec3::Z);
    let [wide, spring, top] = CHANCEL;
    arch(draft, paints.walls, &wall(wide, [spring, top], [-half - OUTER, -half]), edge);
    let [y, radius, square] = ROSE;
    let rose = wall(square, [y - square, y + square], [half, half + OUTER]);
    round_hole(draft, paints.walls, &rose, radius, edge);
    round_pane(draft, paints.rose, &rose, radius, half + 0.5 * OUTER, edge, -Vec3::Z);
}

/// The round wall, built straight (along its inside, up, and minus the radius) and bent, and its half dome.
fn apse(draft: &mut Draft, paints: &Paints, z: f32, edge: f32) {
    let [inner, outer] = APSE;
    let (length, spring) = (PI * inner, CHANCEL[1]);
    let bend = |p: Vec3| {
        let (r, a) = (-p.z, p.x / inner);
        vec3(-r * a.cos(), p.y, z - r * a.sin())
    };
    let mut solid = Solid::default();
    // Nothing is drawn where the wall stands on the floor, carries the dome, or meets the nave.
    let around = 0.1;
    let (lo, hi) = (vec3(-around, -around, -outer), vec3(length + around, spring + around, -inner));
    solid.fill(lo, hi, Fill::Hidden);
    solid.add(vec3(0.0, 0.0, -outer), vec3(length, spring, -inner), paints.walls);
    let [sill, head, half] = EAST_WINDOW;
    let middle = -0.5 * (inner + outer);
    for at in [0.25, 0.5, 0.75] {
        let (a, b) = (at * length - half, at * length + half);
        solid.carve(vec3(a, sill, -outer), vec3(b, head, -inner));
        solid.sheet(vec3(a, sill, middle), vec3(b, head, middle), Vec3::Z, paints.east);
    }
    solid.divide(2, -outer, -inner, 2);
    solid.divide(0, 0.0, length, 24);
    let lines = solid.lines(edge);
    solid.skin(draft, &lines, bend);

    // Both shells of the dome stand on the wall's own lines.
    let foot = lines.between(0, 0.0, length);
    let rises = spread(0.0, 0.5 * PI, foot.len() / 2);
    let centre = vec3(0.0, spring, z);
    for (radius, facing) in [(inner, Facing::Towards(centre)), (outer, Facing::From(centre))] {
        let dome = grid(&foot, &rises, |s, b| {
            let round = vec2((s / inner).cos(), (s / inner).sin()) * b.cos() * radius;
            centre + vec3(-round.x, radius * b.sin(), -round.y)
        });
        draft.patch(paints.walls, &dome, facing);
    }
}
