//! A street: two rows of houses of many heights, pavements, and ground all around.

use glam::vec3;

use super::draft::{Draft, Paint};
use super::solid::Solid;
use super::spec::Values;
use crate::Scene;

/// Half width of the carriageway, and of it with the pavements, m.
const ROAD: f32 = 4.0;
const FRONT: f32 = 7.0;
/// Height of the kerb, m.
const KERB: f32 = 0.15;
/// Ground beyond the houses, m.
const OUTSKIRTS: f32 = 15.0;
/// Linear reflectances of the houses.
const PLASTERS: [[f32; 3]; 5] =
    [[0.66, 0.60, 0.50], [0.52, 0.25, 0.18], [0.45, 0.48, 0.50], [0.72, 0.62, 0.35], [0.35, 0.42, 0.34]];

pub fn town(values: &Values) -> Result<Scene, String> {
    let half = 0.5 * values.get("length");
    let mut dice = Dice(values.count("seed") as u32);
    let mut draft = Draft::default();
    let asphalt = draft.matt("asphalt", [0.12, 0.12, 0.13]);
    let slabs = draft.matt("pavement", [0.38, 0.37, 0.35]);
    let (road, pavement) = (draft.paint("road", asphalt), draft.paint("pavement", slabs));
    let plasters = PLASTERS.map(|albedo| draft.matt("plaster", albedo));
    for (i, &material) in plasters.iter().enumerate() {
        draft.scene.materials[material as usize].name = format!("plaster_{i}");
    }
    let houses = plasters.map(|material| draft.paint("houses", material));

    let mut solid = Solid::default();
    let (wide, long) = (FRONT + 12.0 + OUTSKIRTS, half + OUTSKIRTS);
    solid.add(vec3(-wide, -0.5, -long), vec3(wide, KERB, long), pavement);
    solid.add(vec3(-ROAD, -0.5, -long), vec3(ROAD, 0.0, long), road);
    solid.carve(vec3(-ROAD, 0.0, -long), vec3(ROAD, KERB, long));
    for side in [-1.0, 1.0] {
        row_of_houses(&mut solid, &mut dice, half, side, &houses);
    }
    solid.skin(&mut draft, &solid.lines(values.get("edge")), |p| p);
    Ok(draft.scene)
}

/// Houses from one end of the street to the other; all sizes are whole metres, so that few grid lines are many
/// houses'.
fn row_of_houses(solid: &mut Solid, dice: &mut Dice, half: f32, side: f32, houses: &[Paint]) {
    let mut z = -half.floor();
    while z + 6.0 <= half {
        let [width, depth, height] = [dice.from(6, 14), dice.from(8, 12), dice.from(5, 19)];
        let width = width.min(half.floor() - z);
        let paint = houses[dice.from(0, houses.len() as u32 - 1) as usize];
        let x = [side * FRONT, side * (FRONT + depth)];
        solid.add(vec3(x[0], KERB, z), vec3(x[1], height, z + width), paint);
        // Every other house or so has a storey set back on top.
        if dice.from(0, 1) > 0.0 && width > 6.0 {
            let back = [side * (FRONT + 2.0), side * (FRONT + depth - 2.0)];
            solid.add(vec3(back[0], height, z + 2.0), vec3(back[1], height + 3.0, z + width - 2.0), paint);
        }
        // Now and then a lane between two houses.
        z += width + if dice.from(0, 3) > 2.0 { 3.0 } else { 0.0 };
    }
}

/// A small linear congruential generator (Numerical Recipes' constants): quality does not matter here.
struct Dice(u32);

impl Dice {
    /// A whole number from one to another, both included.
    fn from(&mut self, low: u32, high: u32) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (low + (self.0 >> 16) % (high - low + 1)) as f32
    }
}
