//! Rooms with one opening: a window in a wall, or a small skylight; and the rabbit that lives there.
//!
//! The walls are thick, so that the opening has reveals, and nothing but its pane lets light in. Panes are seen
//! from inside.

use glam::{Vec2, Vec3, vec2, vec3};

use super::blob::rabbit;
use super::draft::Draft;
use super::solid::Solid;
use super::spec::Values;
use crate::Scene;

/// Half width in x, height, and half depth in z of the inside, m.
const ROOM: Vec3 = vec3(2.0, 3.0, 2.5);
/// Thickness of walls, floor and ceiling, m.
const WALL: f32 = 0.25;
/// Depth and width of a window's bars, m.
const BAR: Vec2 = vec2(0.05, 0.03);
/// Share of light that clear glass lets through.
const CLEAR: [f32; 3] = [0.9, 0.9, 0.9];
/// Height of the rabbit, m, and its longest edge beside the room's: it curves.
const RABBIT: f32 = 1.1;
const RABBIT_EDGE: f32 = 0.25;

pub fn box_room(values: &Values) -> Result<Scene, String> {
    let edge = values.get("edge");
    let [width, height] = ["window-width", "window-height"].map(|name| 0.5 * values.get(name));
    let mut draft = Draft::default();
    let mut solid = room(&mut draft);
    // In the west wall, its middle a little above the wall's.
    let middle = (0.5 * ROOM.y + 0.1).min(ROOM.y - height - 0.05);
    let x = -ROOM.x - 0.5 * WALL;
    let glass = draft.glass("glass", CLEAR);
    let window = draft.paint("window", glass);
    solid.carve(vec3(-ROOM.x - WALL, middle - height, -width), vec3(-ROOM.x, middle + height, width));
    solid.sheet(vec3(x, middle - height, -width), vec3(x, middle + height, width), Vec3::X, window);
    let bars = values.get("bars") as u32;
    if bars > 0 {
        let wood = draft.matt("wood", [0.75, 0.75, 0.73]);
        let paint = draft.paint("bars", wood);
        let half = 0.5 * BAR;
        for i in 1..=bars {
            let part = i as f32 / (bars + 1) as f32;
            let (y, z) = (middle + (2.0 * part - 1.0) * height, (2.0 * part - 1.0) * width);
            solid.add(vec3(x - half.x, y - half.y, -width), vec3(x + half.x, y + half.y, width), paint);
            solid.add(
                vec3(x - half.x, middle - height, z - half.y),
                vec3(x + half.x, middle + height, z + half.y),
                paint,
            );
        }
    }
    // The pane's edges in the middle of the reveal.
    solid.divide(0, -ROOM.x - WALL, -ROOM.x, 2);
    let gloss = Gloss { specular: values.get("gloss"), exponent: values.get("exponent") };
    furnish(&mut draft, &solid, edge, gloss);
    Ok(draft.scene)
}

pub fn skylight_box(values: &Values) -> Result<Scene, String> {
    let edge = values.get("edge");
    let half = 0.5 * values.get("opening");
    let mut draft = Draft::default();
    let mut solid = room(&mut draft);
    let y = ROOM.y + 0.5 * WALL;
    let glass = draft.glass("glass", CLEAR);
    let skylight = draft.paint("skylight", glass);
    solid.carve(vec3(-half, ROOM.y, -half), vec3(half, ROOM.y + WALL, half));
    solid.sheet(vec3(-half, y, -half), vec3(half, y, half), -Vec3::Y, skylight);
    solid.divide(1, ROOM.y, ROOM.y + WALL, 2);
    furnish(&mut draft, &solid, edge, MATT);
    Ok(draft.scene)
}

pub fn rabbit_alone(values: &Values) -> Result<Scene, String> {
    let height = values.get("height");
    let mut draft = Draft::default();
    add_rabbit(&mut draft, Vec3::ZERO, height, height / values.get("n"), MATT);
    Ok(draft.scene)
}

/// How the rabbit shines.
struct Gloss {
    /// Ks; the albedo becomes 1 - Ks of what it is without.
    specular: f32,
    exponent: f32,
}

/// No gloss.
const MATT: Gloss = Gloss { specular: 0.0, exponent: 0.0 };

/// The closed room, each wall in its colour.
fn room(draft: &mut Draft) -> Solid {
    let Vec3 { x, y, z } = ROOM;
    let t = WALL;
    let white = draft.matt("white", [0.75, 0.75, 0.73]);
    let sides = [
        ("floor", [0.45, 0.33, 0.22], vec3(-x, -t, -z), vec3(x, 0.0, z)),
        ("east", [0.63, 0.10, 0.07], vec3(x, 0.0, -z), vec3(x + t, y, z)),
        ("south", [0.15, 0.45, 0.12], vec3(-x, 0.0, z), vec3(x, y, z + t)),
    ];
    let mut solid = Solid::default();
    let shell = draft.paint("walls", white);
    solid.add(vec3(-x - t, -t, -z - t), vec3(x + t, y + t, z + t), shell);
    for (name, albedo, lo, hi) in sides {
        let material = draft.matt(name, albedo);
        solid.add(lo, hi, draft.paint(name, material));
    }
    solid.carve(vec3(-x, 0.0, -z), vec3(x, y, z));
    solid
}

fn furnish(draft: &mut Draft, solid: &Solid, edge: f32, gloss: Gloss) {
    solid.skin(draft, &solid.lines(edge), |p| p);
    add_rabbit(draft, vec3(0.5, 0.0, -0.4), RABBIT, RABBIT_EDGE * edge, gloss);
}

fn add_rabbit(draft: &mut Draft, foot: Vec3, height: f32, edge: f32, gloss: Gloss) {
    let reflectance = vec3(0.7, 0.66, 0.6);
    let fur = draft.matt("rabbit", ((1.0 - gloss.specular) * reflectance).into());
    if gloss.specular > 0.0 {
        let coat = &mut draft.scene.materials[fur as usize];
        (coat.specular, coat.exponent) = (Vec3::splat(gloss.specular), gloss.exponent);
    }
    let paint = draft.paint("rabbit", fur);
    rabbit(draft, paint, foot, height, edge);
}
