//! The depth of a window: what of its wall, outside and inside of its pane, hides light that its pane lets through.
//!
//! Along an edge of a convex pane, the wall beside it reaches to some depth in front of and behind the pane's plane. Seen
//! from a point, it hides what lies beyond the line where it ends, which is the edge, moved by that depth along the
//! pane's normal and by an offset away from the pane: so what the point sees through the window is the pane's polygon
//! within the planes through the point and each such line.

use glam::Vec3;

use crate::cubemap::footprint::clip;

/// Of one step of an edge's wall, metres: depth outside and offset there, depth inside and offset there. A depth of 0 hides nothing.
pub type Reveal = [f32; 4];

/// Nearer to the end of an inner reveal than this part of its depth a point lies on it, and sees past it.
const LEVEL: f32 = 1e-3;

/// A convex polygon with the wall around it.
#[derive(Clone, Debug)]
pub struct Pane {
    /// Metres, counter-clockwise as seen from inside.
    corners: Vec<Vec3>,
    centre: Vec3,
    /// Unit, towards the inside.
    normal: Vec3,
    ends: Vec<End>,
}

/// A line at which a wall ends.
#[derive(Clone, Copy, Debug)]
struct End {
    from: Vec3,
    to: Vec3,
    /// Points lower than this over the pane's plane see past it, metres.
    above: f32,
}

impl Pane {
    /// Of corners, metres, counter-clockwise as seen from inside; `reveals` has as many entries for each edge, of which the
    /// first begins at the first corner, or none.
    pub fn new(corners: &[Vec3], reveals: &[Reveal]) -> Pane {
        let (centre, normal) = plane_of(corners);
        let steps = (reveals.len() / corners.len().max(1)).max(1);
        let mut ends = Vec::new();
        for (i, reveals) in reveals.chunks(steps).enumerate() {
            let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
            let away = (b - a).cross(normal).normalize_or_zero();
            for &[outer, outer_offset, inner, inner_offset] in reveals {
                let mut end = |depth: f32, offset: f32, above: f32| {
                    let to = offset * away - depth * normal;
                    ends.push(End { from: a + to, to: b + to, above });
                };
                if outer > 0.0 {
                    end(outer, outer_offset, 0.0);
                }
                if inner > 0.0 {
                    end(-inner, inner_offset, (1.0 + LEVEL) * inner);
                }
            }
        }
        Pane { corners: corners.to_vec(), centre, normal, ends }
    }

    /// Metres, counter-clockwise as seen from inside.
    pub fn corners(&self) -> &[Vec3] {
        &self.corners
    }

    /// The mean of the corners.
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    /// Unit, towards the inside.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// How far inside of the pane's plane a point lies, metres.
    pub fn height(&self, p: Vec3) -> f32 {
        self.normal.dot(p - self.centre)
    }

    /// The normals, of any length and towards what is seen, of the planes through `p` and the ends of its wall; none from outside
    /// or from its own plane, from where nothing is seen through it.
    pub(super) fn walls(&self, p: Vec3) -> impl Iterator<Item = Vec3> + '_ {
        let height = self.height(p);
        let ends = self.ends.iter().filter(move |end| height > end.above);
        ends.map(move |end| (end.to - p).cross(end.from - p))
    }

    /// What of it `p` sees light through: of the two lists, the first holds the result.
    pub fn seen_from(&self, p: Vec3, lists: &mut [Vec<Vec3>; 2]) {
        let [seen, other] = lists;
        seen.clear();
        seen.extend(&self.corners);
        for side in self.walls(p) {
            clip(seen, other, |q| side.dot(q - p));
            std::mem::swap(seen, other);
        }
    }
}

/// Centre of a polygon's corners, and its unit normal, towards where it is seen counter-clockwise from.
pub fn plane_of(polygon: &[Vec3]) -> (Vec3, Vec3) {
    let centre = polygon.iter().sum::<Vec3>() / polygon.len().max(1) as f32;
    let next = polygon.iter().cycle().skip(1);
    let turned = polygon.iter().zip(next).map(|(a, b)| (*a - centre).cross(*b - centre));
    (centre, turned.sum::<Vec3>().normalize_or_zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pane of 2 m x 1 m at z = 0, whose inside is at +z.
    fn pane() -> [Vec3; 4] {
        [[-1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f32; 2]| Vec3::new(x, y, 0.0))
    }

    fn extent(p: Vec3, reveals: &[Reveal]) -> [f32; 4] {
        let mut lists = [Vec::new(), Vec::new()];
        Pane::new(&pane(), reveals).seen_from(p, &mut lists);
        let [x, y] = [0, 1].map(|axis| {
            lists[0].iter().fold((f32::MAX, f32::MIN), |(l, h), q| (l.min(q[axis]), h.max(q[axis])))
        });
        [x.0, x.1, y.0, y.1]
    }

    #[test]
    fn walls_hide_what_a_ray_past_them_would_cross() {
        let none = [0.0; 4];
        assert_eq!(extent(Vec3::new(3.0, 0.5, 2.0), &[]), [-1.0, 1.0, 0.0, 1.0]);
        assert_eq!(extent(Vec3::new(3.0, 0.5, 2.0), &[none; 4]), [-1.0, 1.0, 0.0, 1.0]);
        // From the right, light over the left wall's outer end, 0.5 m out, crosses the pane 4/2.5 x 2 - ... :
        let left = [none, none, none, [0.5, 0.0, 0.0, 0.0]];
        let seen = extent(Vec3::new(3.0, 0.5, 2.0), &left);
        assert!((seen[0] - (3.0 - 4.0 * 2.0 / 2.5)).abs() < 1e-5, "{seen:?}");
        // The end lies 0.25 m aside: less is hidden.
        let wide = [none, none, none, [0.5, 0.25, 0.0, 0.0]];
        let seen = extent(Vec3::new(3.0, 0.5, 2.0), &wide);
        assert!((seen[0] - (3.0 - 4.25 * 2.0 / 2.5)).abs() < 1e-5, "{seen:?}");
        // Inside, it is the right wall that is in the way, at 1 m of the 2 m.
        let right = [none, [0.0, 0.0, 1.0, 0.0], none, none];
        let seen = extent(Vec3::new(2.0, 0.5, 2.0), &right);
        assert!((seen[1] - 0.0).abs() < 1e-5, "{seen:?}");
        // On the reveal itself, nothing is.
        assert_eq!(extent(Vec3::new(1.0, 0.5, 1.0), &right), [-1.0, 1.0, 0.0, 1.0]);
        // Of two steps of the left wall, the nearer one hides more here, and the farther one from farther aside.
        let near = [0.05, 0.0, 0.0, 0.0];
        let steps = [none, none, none, none, none, none, near, [0.5, 0.25, 0.0, 0.0]];
        let seen = extent(Vec3::new(-0.9, 0.5, 2.0), &steps);
        assert!((seen[0] - (-0.9 - 0.1 * 2.0 / 2.05)).abs() < 1e-5, "{seen:?}");
        let seen = extent(Vec3::new(3.0, 0.5, 2.0), &steps);
        assert!((seen[0] - (3.0 - 4.25 * 2.0 / 2.5)).abs() < 1e-5, "{seen:?}");
        // All is hidden from far aside.
        let seen = extent(Vec3::new(30.0, 0.5, 0.2), &[none, none, none, [1.0, 0.0, 0.0, 0.0]]);
        assert!(seen[0] > seen[1], "{seen:?}");
    }
}
