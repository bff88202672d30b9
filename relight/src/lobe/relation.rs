//! How a sphere lies to the cone of a lamp: beside it, before all of it, or across it.

use super::Sphere;
use super::blockers::{Eight, LANES};
use super::mask::Cone;

/// How a sphere lies to the cone of a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// Beside it or behind it.
    Apart,
    /// It hides the lamp.
    Covers,
    /// It reaches into the cone, all of it in front of the lamp.
    InFront,
    /// It reaches into the cone and perhaps behind the lamp, or holds the point.
    Mixed,
}

/// Lanes of an eight that are not [`Relation::Apart`] by their angle.
#[inline(always)]
pub(super) fn reaching(cone: &Cone, eight: &Eight) -> impl Iterator<Item = usize> {
    let mut beyond = [0.0; LANES];
    for (lane, beyond) in beyond.iter_mut().enumerate() {
        let (x, y, z) =
            (eight.x[lane] - cone.apex.x, eight.y[lane] - cone.apex.y, eight.z[lane] - cone.apex.z);
        let squared = x * x + y * y + z * z;
        let r = eight.radius[lane];
        let tangent = (squared - r * r).max(0.0).sqrt();
        let along = x * cone.axis.x + y * cone.axis.y + z * cone.axis.z;
        *beyond = (along - (cone.cos * tangent - cone.sin * r)).max(r * r - squared);
    }
    (0..LANES).filter(move |&lane| beyond[lane] >= 0.0)
}

/// Points this close to a sphere's surface, relative to its radius, count as on it and not in it.
pub(super) const SKIN: f32 = 1e-4;

#[inline(always)]
pub(super) fn relation(cone: &Cone, sphere: &Sphere) -> Relation {
    let to = sphere.centre - cone.apex;
    let squared = to.length_squared();
    let r = sphere.radius;
    let tangent = (squared - r * r).max(0.0).sqrt();
    let along = to.dot(cone.axis);
    // Cones meet when the angle is below the sum of their radii; all times the distance.
    if squared > r * r && along <= cone.cos * tangent - cone.sin * r {
        return Relation::Apart;
    }
    settle(cone, sphere, squared, tangent, along)
}

/// The rarer cases of [`relation`].
fn settle(cone: &Cone, sphere: &Sphere, squared: f32, tangent: f32, along: f32) -> Relation {
    let r = sphere.radius;
    let inner = r * (1.0 - SKIN);
    if squared < inner * inner {
        return Relation::Covers;
    }
    let rim = cone.distance * cone.cos;
    if squared >= (rim + r) * (rim + r) {
        return Relation::Apart;
    }
    let in_front = tangent <= cone.distance - cone.lamp_radius;
    let covers = r * r >= cone.sin * cone.sin * squared && along >= cone.cos * tangent + cone.sin * r;
    match (in_front, covers) {
        (true, true) => Relation::Covers,
        (true, false) => Relation::InFront,
        _ => Relation::Mixed,
    }
}
