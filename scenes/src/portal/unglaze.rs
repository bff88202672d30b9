//! Portals from a file, against the glass that the scene has itself.
//!
//! Glass blocks light in a bake, as everything does that is left in the mesh; where a portal lies in it, the glass
//! has to go: every see-through triangle that is nearly parallel to a portal and no farther before or behind it than
//! a double glazing is thick, and what hangs together with it by corners. A drinking glass stays.
//!
//! Where it breaks: a glass cube pressed against a window pane goes with it.

use std::collections::HashSet;

use glam::Vec3;

use super::split::labels;
use super::{Portal, take};
use crate::names::count;
use crate::scene::{Error, Scene};

/// Thickest glazing, metres.
const GLAZING: f32 = 0.1;

/// Panes are parallel to their portal: cosine of the largest angle, 14 degrees, for bent ones.
const PARALLEL: f32 = 0.97;

/// A middle this far beyond an edge, as a share of the triangle's height, still lies in it: rounding.
const EDGE: f32 = 1e-3;

/// Takes the glass that lies in these portals out of the mesh; says in the scene's report how much, and what glass is
/// left, which a bake takes for opaque.
///
/// # Errors
/// [`Error::Invalid`] if no triangle would be left to light. The scene is not changed then.
pub fn unglaze(scene: &mut Scene, portals: &[Portal]) -> Result<(), Error> {
    let glass: Vec<usize> = (0..scene.mesh.index.len()).filter(|t| is_glass(scene, *t)).collect();
    let corners = |t: usize| scene.mesh.index[t].map(|v| scene.mesh.position[v as usize]);
    let panes: Vec<[Vec3; 3]> = glass.iter().map(|t| corners(*t)).collect();
    let gates: Vec<Gate> = portals.iter().flat_map(|p| &p.triangles).map(Gate::new).collect();
    let label = labels(&panes);
    let covered = |(pane, label): (&[Vec3; 3], &u32)| gates.iter().any(|g| g.holds(pane)).then_some(*label);
    let open: HashSet<u32> = panes.iter().zip(&label).filter_map(covered).collect();
    let mut kept = vec![true; scene.mesh.index.len()];
    glass.iter().zip(&label).filter(|(_, label)| open.contains(label)).for_each(|(t, _)| kept[*t] = false);
    let n = kept.iter().filter(|k| !**k).count();
    if n == kept.len() {
        let what = "every triangle of the scene lies in a portal, and none is left to be lit".into();
        return Err(Error::Invalid { at: "portals".into(), what });
    }
    if n > 0 {
        scene.mesh = take::compacted(&scene.mesh, &kept);
        scene.report.push(format!("{} of glass taken out for the portals", count(n, "triangle")));
    }
    if n < glass.len() {
        scene.report.push(format!(
            "{} of glass are in no portal, and opaque in a bake",
            count(glass.len() - n, "triangle")
        ));
    }
    Ok(())
}

fn is_glass(scene: &Scene, triangle: usize) -> bool {
    scene.materials[scene.mesh.material[triangle] as usize].is_see_through()
}

/// A portal's triangle with what is asked of it often.
struct Gate {
    corners: [Vec3; 3],
    normal: Vec3,
    low: Vec3,
    high: Vec3,
}

impl Gate {
    fn new(corners: &[Vec3; 3]) -> Gate {
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let (low, high) = (a.min(b).min(c) - GLAZING, a.max(b).max(c) + GLAZING);
        Gate { corners: *corners, normal, low, high }
    }

    /// Whether the middle of a pane's triangle lies before, in or just behind it.
    fn holds(&self, [a, b, c]: &[Vec3; 3]) -> bool {
        let middle = (*a + *b + *c) / 3.0;
        if middle.cmplt(self.low).any() || middle.cmpgt(self.high).any() {
            return false;
        }
        let facing = (*b - *a).cross(*c - *a).normalize_or_zero().dot(self.normal).abs();
        facing > PARALLEL
            && (middle - self.corners[0]).dot(self.normal).abs() < GLAZING
            && self.is_over(middle)
    }

    /// Whether a point is over the triangle, seen along its normal.
    fn is_over(&self, p: Vec3) -> bool {
        let whole = self.corners[1] - self.corners[0];
        let twice_area = whole.cross(self.corners[2] - self.corners[0]).length();
        (0..3).all(|i| {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % 3]);
            (to - from).cross(p - from).dot(self.normal) >= -EDGE * twice_area
        })
    }
}
