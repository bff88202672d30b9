//! A saloon car: a hollow body with panes in its window openings, seats and a dashboard.
//!
//! Built square and then bent, above the belt line, into a tapering cabin with raked screens, and below into a
//! rounded bonnet and boot. The front is at -z.

use glam::{Vec3, vec2, vec3};

use super::draft::{Draft, Paint};
use super::shapes::{disc, lathe, pieces, round};
use super::solid::Solid;
use super::spec::Values;
use crate::Scene;

/// Half width and half length of the body, m.
const HALF: [f32; 2] = [0.86, 2.2];
/// Underside, sill of the doors, belt line and roof, m.
const HEIGHT: [f32; 4] = [0.22, 0.34, 0.92, 1.44];
/// Front and back of the cabin at the belt line, m.
const CABIN: [f32; 2] = [-0.95, 1.45];
/// How far the tops of the front and of the rear screen lean inwards, m.
const RAKE: [f32; 2] = [0.62, 0.45];
/// How much the sides lean in at the roof, of their distance from the middle.
const LEAN: f32 = 0.2;
/// Thickness of the body, and width of the pillars, m.
const SKIN: f32 = 0.06;
const PILLAR: f32 = 0.09;
/// Radius and width of the wheels, m, and how far axles are from the middle.
const WHEEL: [f32; 2] = [0.31, 0.2];
const AXLE: f32 = 1.35;

pub fn car(values: &Values) -> Result<Scene, String> {
    let edge = values.get("edge");
    let mut draft = Draft::default();
    let mut solid = body(&mut draft);
    windows(&mut draft, &mut solid);
    seats(&mut draft, &mut solid);
    solid.skin(&mut draft, &solid.lines(edge), bend);
    let rubber = draft.matt("rubber", [0.04, 0.04, 0.04]);
    let tyres = draft.paint("wheels", rubber);
    for (x, z) in [(-1.0, -AXLE), (1.0, -AXLE), (-1.0, AXLE), (1.0, AXLE)] {
        wheel(&mut draft, tyres, x, z, edge);
    }
    Ok(draft.scene)
}

/// Body and cabin, hollow, with wells for the wheels.
fn body(draft: &mut Draft) -> Solid {
    let lacquer = draft.matt("lacquer", [0.45, 0.05, 0.06]);
    let lining = draft.matt("lining", [0.5, 0.48, 0.44]);
    let (shell, inside) = (draft.paint("body", lacquer), draft.paint("inside", lining));
    let [w, l] = HALF;
    let [under, sill, belt, roof] = HEIGHT;
    let [front, back] = CABIN;
    let half = 0.5 * SKIN;
    let mut solid = Solid::default();
    solid.add(vec3(-w, under, -l), vec3(w, belt, l), shell);
    solid.add(vec3(-w, belt, front), vec3(w, roof, back), shell);
    // The inner half of the skin is lining.
    let [lo, hi] = [vec3(half - w, sill - half, front + half), vec3(w - half, roof - half, back - half)];
    solid.add(lo, hi, inside);
    solid.carve(lo + half, hi - half);
    for (side, z) in [(-1.0, -AXLE), (1.0, -AXLE), (-1.0, AXLE), (1.0, AXLE)] {
        let [radius, width] = WHEEL;
        let reach = radius + 0.06;
        // Where a well reaches into the cabin it has walls of its own.
        let inner = side * (w - width - 0.04);
        let housing = reach + SKIN;
        solid.add(vec3(side * w, under, z - housing), vec3(inner - side * SKIN, 0.72, z + housing), shell);
        solid.carve(vec3(side * w, under, z - reach), vec3(inner, 0.66, z + reach));
    }
    solid
}

/// Openings and panes: screens in front and behind, two windows on each side.
fn windows(draft: &mut Draft, solid: &mut Solid) {
    let [w, _] = HALF;
    let [_, _, belt, roof] = HEIGHT;
    let [front, back] = CABIN;
    let glass = draft.glass("glass", [0.82, 0.86, 0.84]);
    let (lo, hi) = (belt + 0.02, roof - SKIN - 0.02);
    let half = 0.5 * SKIN;
    for (z, inwards, name) in [(front, 1.0, "windscreen"), (back, -1.0, "rear screen")] {
        let pane = draft.paint(name, glass);
        let (x, middle) = (w - PILLAR, z + inwards * half);
        solid.carve(vec3(-x, lo, z), vec3(x, hi, z + inwards * SKIN));
        solid.sheet(vec3(-x, lo, middle), vec3(x, hi, middle), inwards * Vec3::Z, pane);
    }
    let post = 0.5 * (front + back);
    for side in [-1.0, 1.0] {
        let pane = draft.paint("side windows", glass);
        for (a, b) in [(front + PILLAR + SKIN, post - half), (post + half, back - PILLAR - SKIN)] {
            let middle = side * (w - half);
            solid.carve(vec3(side * w, lo, a), vec3(side * (w - SKIN), hi, b));
            solid.sheet(vec3(middle, lo, a), vec3(middle, hi, b), -side * Vec3::X, pane);
        }
    }
}

/// Two seats, a bench and a dashboard, as blocks on the floor.
fn seats(draft: &mut Draft, solid: &mut Solid) {
    let cloth = draft.matt("cloth", [0.16, 0.18, 0.24]);
    let plastic = draft.matt("dashboard", [0.10, 0.10, 0.10]);
    let (seat, dash) = (draft.paint("seats", cloth), draft.paint("dashboard", plastic));
    let floor = HEIGHT[1];
    // The bench fits between the housings of the wheels.
    let (wide, bench) = (HALF[0] - SKIN, 0.5);
    for x in [-0.4, 0.4] {
        solid.add(vec3(x - 0.25, floor, -0.2), vec3(x + 0.25, 0.56, 0.34), seat);
        solid.add(vec3(x - 0.25, 0.56, 0.22), vec3(x + 0.25, 1.08, 0.34), seat);
    }
    solid.add(vec3(-bench, floor, 0.72), vec3(bench, 0.56, 1.2), seat);
    solid.add(vec3(-bench, 0.56, 1.08), vec3(bench, 1.0, 1.2), seat);
    solid.add(vec3(-wide, 0.62, CABIN[0] + SKIN), vec3(wide, 0.84, CABIN[0] + 0.4), dash);
}

/// The square body's points in the shape of a car.
fn bend(p: Vec3) -> Vec3 {
    let [w, l] = HALF;
    let [_, _, belt, roof] = HEIGHT;
    let [front, back] = CABIN;
    let t = ((p.y - belt) / (roof - belt)).max(0.0);
    // Between the screens their rakes blend.
    let s = ((p.z - front) / (back - front)).clamp(0.0, 1.0);
    let rake = RAKE[0] * (1.0 - s) - RAKE[1] * s;
    // The nose and the tail narrow, and fall away towards their ends.
    let end = ((p.z.abs() - 1.2) / (l - 1.2)).max(0.0);
    let low = ((belt - p.y) / (belt - HEIGHT[0])).clamp(0.0, 1.0);
    let drop = 0.22 * end * end * (1.0 - low);
    let belly = 0.05 * (1.0 - low) * low * 4.0;
    let narrow = 1.0 - LEAN * t - 0.12 * end * end + belly * 0.5;
    // The roof is arched by a twentieth of its half width.
    let arch = 0.05 * t * (1.0 - (p.x / w) * (p.x / w));
    vec3(p.x * narrow, p.y - drop + arch, p.z + rake * t)
}

/// A closed tyre, in its well.
fn wheel(draft: &mut Draft, paint: Paint, side: f32, z: f32, edge: f32) {
    let [radius, width] = WHEEL;
    let mut upright = Draft::default();
    let angles = round(pieces(std::f32::consts::TAU * radius, edge).max(20));
    lathe(&mut upright, paint, Vec3::ZERO, &[vec2(radius, 0.0), vec2(radius, width)], &angles);
    disc(&mut upright, paint, Vec3::ZERO, [0.0, radius], &angles, edge, -Vec3::Y);
    disc(&mut upright, paint, width * Vec3::Y, [0.0, radius], &angles, edge, Vec3::Y);
    // Laid on its side: (x, y, z) to (y, z, x) turns without mirroring.
    let near = if side > 0.0 { HALF[0] - width - 0.02 } else { -HALF[0] + 0.02 };
    let lay = |p: &Vec3| vec3(p.y, p.z, p.x);
    let mesh = &upright.scene.mesh;
    let position: Vec<Vec3> = mesh.position.iter().map(|p| lay(p) + vec3(near, radius, z)).collect();
    let normal: Vec<Vec3> = mesh.normal.iter().map(lay).collect();
    draft.add(paint, &position, &normal, &mesh.index);
}
