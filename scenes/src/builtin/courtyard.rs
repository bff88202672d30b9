//! A court with arcades.
//!
//! Everything but the round parts is one solid, and the floor runs on under the walls, so that no light comes
//! in but from above.

use glam::{Vec3, vec2, vec3};

use super::draft::{Draft, Paint};
use super::shapes::{Wall, arch, around, column, disc, lathe, slope, sphere};
use super::solid::{Fill, Lines, Solid};
use super::spec::Values;
use crate::Scene;

/// Thickness of the arcade, also the width of plinths, m.
const ARCADE: f32 = 0.5;
/// Depth of the walk behind the arcade, m.
const WALK: f32 = 2.6;
/// Thickness of the outer walls, m.
const OUTER: f32 = 0.4;
/// Where arches spring, m: the top of the columns.
const SPRING: f32 = 2.4;
/// Height of plinths and of the slabs on the capitals, m.
const SLAB: f32 = 0.2;
/// Wall above the crown of an arch, m, and from there to the ceiling of the walk.
const CROWN: f32 = 0.25;
/// Height of the storey above, m.
const STOREY: f32 = 3.2;
/// Narrowest arch and widest, m, between columns.
const SPAN: [f32; 2] = [0.4, 5.0];

/// Everything that follows from the parameters.
struct Plan {
    /// Half of the side of the court.
    court: f32,
    /// From the middle to the inner side of the outer walls.
    wall: f32,
    /// Arches of a side.
    bays: usize,
    /// From column to column.
    bay: f32,
    /// Top of the rectangle around an arch.
    top: f32,
    /// Ceiling of the walk.
    ceiling: f32,
    /// Top of the walls.
    height: f32,
}

fn plan(values: &Values) -> Result<Plan, String> {
    let court = 0.5 * values.get("size");
    let bays = values.count("columns") + 1;
    let bay = (2.0 * court + ARCADE) / bays as f32;
    let span = bay - ARCADE;
    if !(SPAN[0]..=SPAN[1]).contains(&span) {
        let [narrow, wide] = SPAN;
        let columns = bays - 1;
        return Err(format!(
            "{columns} columns on {} m leave arches of {span:.2} m; choose between {narrow} and {wide} m",
            2.0 * court
        ));
    }
    let top = SPRING + 0.5 * span + CROWN;
    let ceiling = top + CROWN;
    Ok(Plan { court, wall: court + ARCADE + WALK, bays, bay, top, ceiling, height: ceiling + STOREY })
}

pub fn courtyard(values: &Values) -> Result<Scene, String> {
    let plan = plan(values)?;
    let edge = values.get("edge");
    let mut draft = Draft::default();
    let stone = draft.matt("stone", [0.62, 0.57, 0.48]);
    let arcade = draft.paint("arcade", stone);
    let mut solid = Solid::default();
    walls(&mut draft, &mut solid, &plan);
    open_arcade(&mut solid, &plan, arcade);
    let fountain = 0.1 * plan.court.min(12.0) + 0.4;
    fountain_place(&mut solid, fountain);
    let lines = solid.lines(edge);
    solid.skin(&mut draft, &lines, |p| p);
    round_arcade(&mut draft, &lines, &plan, arcade, edge);
    let basin = draft.paint("fountain", stone);
    draw_fountain(&mut draft, &lines, basin, fountain, edge);
    Ok(draft.scene)
}

/// Floor, outer walls in four colours, the storey above, its recesses and cornices.
fn walls(draft: &mut Draft, solid: &mut Solid, plan: &Plan) {
    let (c, w, top) = (plan.court, plan.wall, plan.height);
    let e = w + OUTER;
    let paving = draft.matt("paving", [0.42, 0.40, 0.37]);
    let tiles = draft.matt("tiles", [0.55, 0.30, 0.20]);
    let plaster = draft.matt("plaster", [0.75, 0.68, 0.55]);
    let [walk, court] = [draft.paint("walk", tiles), draft.paint("court", paving)];
    let storey = draft.paint("storey", plaster);

    // The ground goes on for a metre outside.
    solid.add(vec3(-e - 1.0, -0.4, -e - 1.0), vec3(e + 1.0, 0.0, e + 1.0), walk);
    solid.add(vec3(-c, -0.4, -c), vec3(c, 0.0, c), court);
    solid.add(vec3(-e, 0.0, -e), vec3(e, top, e), storey);
    // The colours are on the inner half of the walls.
    let h = w + 0.5 * OUTER;
    let colours = [
        ("east", [0.68, 0.20, 0.12], vec3(w, 0.0, -w), vec3(h, plan.ceiling, w)),
        ("west", [0.16, 0.35, 0.52], vec3(-h, 0.0, -w), vec3(-w, plan.ceiling, w)),
        ("north", [0.75, 0.55, 0.18], vec3(-w, 0.0, -h), vec3(w, plan.ceiling, -w)),
        ("south", [0.30, 0.48, 0.26], vec3(-w, 0.0, w), vec3(w, plan.ceiling, h)),
    ];
    for (side, albedo, lo, hi) in colours {
        let material = draft.matt(&format!("plaster_{side}"), albedo);
        solid.add(lo, hi, draft.paint(side, material));
    }
    solid.carve(vec3(-w, 0.0, -w), vec3(w, plan.ceiling, w));

    // Two cornices stand out into the court, below the storey and at the top.
    solid.carve(vec3(-c, 0.0, -c), vec3(c, top, c));
    for y in [plan.ceiling, top - SLAB] {
        solid.add(vec3(-c, y, -c), vec3(c, y + SLAB, c), storey);
        solid.carve(vec3(-c + SLAB, y, -c + SLAB), vec3(c - SLAB, y + SLAB, c - SLAB));
    }
    recesses(solid, plan);
}

/// A blind window over each arch.
fn recesses(solid: &mut Solid, plan: &Plan) {
    let (half, sill) = (0.2 * plan.bay, plan.ceiling + SLAB + 0.6);
    for_sides(plan, |side| {
        for i in 0..plan.bays {
            let u = plan.bay_start(i) + 0.5 * plan.bay;
            let [lo, hi] = side.block([u - half, u + half], [sill, plan.height - 0.8], [0.0, 0.3]);
            solid.carve(lo, hi);
        }
    });
}

/// One side of the court: along x or z, in front or behind.
#[derive(Clone, Copy)]
struct Side {
    along_x: f32,
    sign: f32,
    court: f32,
}

impl Side {
    /// From along the side, height and depth behind the court's face to the scene.
    fn place(self, u: f32, y: f32, d: f32) -> Vec3 {
        let across = self.sign * (self.court + d);
        if self.along_x > 0.0 { vec3(u, y, across) } else { vec3(across, y, u) }
    }

    fn block(self, u: [f32; 2], y: [f32; 2], d: [f32; 2]) -> [Vec3; 2] {
        let (a, b) = (self.place(u[0], y[0], d[0]), self.place(u[1], y[1], d[1]));
        [a.min(b), a.max(b)]
    }

    /// Axis along the side and axis across it.
    fn axes(self) -> [usize; 2] {
        if self.along_x > 0.0 { [0, 2] } else { [2, 0] }
    }
}

impl Plan {
    /// The middle of the column at the beginning of a bay.
    fn bay_start(&self, i: usize) -> f32 {
        -(self.court + 0.5 * ARCADE) + i as f32 * self.bay
    }
}

fn for_sides(plan: &Plan, mut each: impl FnMut(Side)) {
    for (along_x, sign) in [(1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)] {
        each(Side { along_x, sign, court: plan.court });
    }
}

/// The arcade's wall, open where arches and columns come.
fn open_arcade(solid: &mut Solid, plan: &Plan, paint: Paint) {
    let corner = plan.court + ARCADE;
    for_sides(plan, |side| {
        let [lo, hi] = side.block([-corner, corner], [0.0, plan.ceiling], [0.0, ARCADE]);
        solid.add(lo, hi, paint);
    });
    // Only now, for the sides overlap at the corners.
    for_sides(plan, |side| {
        let [along, across] = side.axes();
        let depth = [side.place(0.0, 0.0, 0.0)[across], side.place(0.0, 0.0, ARCADE)[across]];
        // Four squares a plinth give a column of sixteen sides or more.
        solid.divide(across, depth[0].min(depth[1]), depth[0].max(depth[1]), 4);
        for i in 0..plan.bays {
            let [from, to] = opening(plan, i);
            let [lo, hi] = side.block([from, to], [0.0, SPRING], [0.0, ARCADE]);
            solid.carve(lo, hi);
            let [lo, hi] = side.block([from, to], [SPRING, plan.top], [0.0, ARCADE]);
            solid.fill(lo, hi, Fill::Hidden);
            solid.divide(along, from, to, 8);
        }
        for i in 1..plan.bays {
            let u = [plan.bay_start(i) - 0.5 * ARCADE, plan.bay_start(i) + 0.5 * ARCADE];
            let [lo, hi] = side.block(u, [SLAB, SPRING - SLAB], [0.0, ARCADE]);
            solid.fill(lo, hi, Fill::Hidden);
            solid.divide(along, u[0], u[1], 4);
        }
    });
    solid.divide(1, SPRING, plan.top, 4);
}

/// From column to column.
fn opening(plan: &Plan, i: usize) -> [f32; 2] {
    [plan.bay_start(i) + 0.5 * ARCADE, plan.bay_start(i + 1) - 0.5 * ARCADE]
}

/// Arches and columns.
fn round_arcade(draft: &mut Draft, lines: &Lines, plan: &Plan, paint: Paint, edge: f32) {
    for_sides(plan, |side| {
        let [along, across] = side.axes();
        let depth = {
            let (a, b) = (side.place(0.0, 0.0, 0.0)[across], side.place(0.0, 0.0, ARCADE)[across]);
            lines.between(across, a.min(b), a.max(b))
        };
        for i in 0..plan.bays {
            let [from, to] = opening(plan, i);
            let place = |u: f32, y: f32, d: f32| side.place(u, y, side.sign * d - side.court);
            let wall = Wall {
                along: lines.between(along, from, to),
                up: lines.between(1, SPRING, plan.top),
                through: depth.clone(),
                place: &place,
            };
            arch(draft, paint, &wall, edge);
        }
        for i in 1..plan.bays {
            let u = plan.bay_start(i);
            let run = lines.between(along, u - 0.5 * ARCADE, u + 0.5 * ARCADE);
            let [x, z] = if along == 0 { [&run, &depth] } else { [&depth, &run] };
            column(draft, paint, [x, z], [SLAB, SPRING - SLAB], 0.36 * ARCADE, edge);
        }
    });
}

/// The square in the middle of the court that the fountain's own ring of paving fills.
fn fountain_place(solid: &mut Solid, radius: f32) {
    let half = 1.25 * radius;
    solid.fill(vec3(-half, 0.0, -half), vec3(half, 0.5, half), Fill::Hidden);
    for axis in [0, 2] {
        solid.divide(axis, -half, half, 8);
    }
}

/// Two round steps and a ball.
fn draw_fountain(draft: &mut Draft, lines: &Lines, paint: Paint, radius: f32, edge: f32) {
    let half = 1.25 * radius;
    let [x, z] = [0, 2].map(|axis| lines.between(axis, -half, half));
    let (foot, angles) = around(draft, paint, [&x, &z], 0.0, radius, edge, Vec3::Y);
    let (inner, low, high) = (0.6 * radius, 0.3, 0.7);
    lathe(draft, paint, foot, &slope(vec2(radius, 0.0), vec2(radius, low), edge), &angles);
    disc(draft, paint, foot + low * Vec3::Y, [inner, radius], &angles, edge, Vec3::Y);
    lathe(draft, paint, foot, &slope(vec2(inner, low), vec2(inner, high), edge), &angles);
    disc(draft, paint, foot + high * Vec3::Y, [0.0, inner], &angles, edge, Vec3::Y);
    let ball = 0.7 * inner;
    sphere(draft, paint, foot + (high + ball) * Vec3::Y, ball, edge);
}
