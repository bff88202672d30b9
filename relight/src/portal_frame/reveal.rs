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

/// Calls `met` with the normals, of any length and towards what is seen, of the planes through `p` and the ends of the
/// reveals of the edge from `a` to `b` of a pane with this unit normal, towards the inside, at which `p` is `height`
/// metres above the pane's plane.
pub(super) fn for_each_end(
    (p, height): (Vec3, f32),
    normal: Vec3,
    (a, b): (Vec3, Vec3),
    reveal: &Reveal,
    mut met: impl FnMut(Vec3),
) {
    let &[outer, outer_offset, inner, inner_offset] = reveal;
    // From outside, or from its own plane, nothing is seen through it.
    if height <= 0.0 || outer.max(inner) <= 0.0 {
        return;
    }
    let away = (b - a).cross(normal).normalize_or_zero();
    let mut end = |depth: f32, offset: f32| {
        let to = offset * away - depth * normal - p;
        met((b + to).cross(a + to));
    };
    if outer > 0.0 {
        end(outer, outer_offset);
    }
    if inner > 0.0 && height > (1.0 + LEVEL) * inner {
        end(-inner, inner_offset);
    }
}

/// Centre of a polygon's corners, and its unit normal, towards where it is seen counter-clockwise from.
pub fn plane_of(polygon: &[Vec3]) -> (Vec3, Vec3) {
    let centre = polygon.iter().sum::<Vec3>() / polygon.len().max(1) as f32;
    let next = polygon.iter().cycle().skip(1);
    let turned = polygon.iter().zip(next).map(|(a, b)| (*a - centre).cross(*b - centre));
    (centre, turned.sum::<Vec3>().normalize_or_zero())
}

/// What of a convex pane, counter-clockwise as seen from inside, `p` sees light through; `reveals` has as many entries for each edge,
/// of which the first begins at the first corner, or none. Of the two lists, the first holds the result.
pub fn seen_through(p: Vec3, pane: &[Vec3], reveals: &[Reveal], lists: &mut [Vec<Vec3>; 2]) {
    let [seen, other] = lists;
    seen.clear();
    seen.extend(pane);
    let next = |i: usize| pane[(i + 1) % pane.len()];
    let (centre, normal) = plane_of(pane);
    let height = normal.dot(p - centre);
    let steps = (reveals.len() / pane.len().max(1)).max(1);
    for (i, (a, reveals)) in pane.iter().zip(reveals.chunks(steps)).enumerate() {
        for reveal in reveals {
            for_each_end((p, height), normal, (*a, next(i)), reveal, |side| {
                clip(seen, other, |q| side.dot(q - p));
                std::mem::swap(seen, other);
            });
        }
    }
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
        seen_through(p, &pane(), reveals, &mut lists);
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
        // All is hidden from far aside.
        let seen = extent(Vec3::new(30.0, 0.5, 0.2), &[none, none, none, [1.0, 0.0, 0.0, 0.0]]);
        assert!(seen[0] > seen[1], "{seen:?}");
    }
}
