//! A camera that shows a scene without being told where to stand.
//!
//! An open scene (an object, a terrain, a courtyard seen as a model) is looked at from above at three quarters, from
//! as near as all vertices fit. A scene is an interior where most rays from its middle end on the fronts of
//! surfaces; then the camera stands inside, at the one of a few places along the walls from where it sees farthest
//! across, and looks through the middle.
//!
//! It breaks where surfaces of an interior face outwards: such a scene is shown from outside.

use crate::camera::Camera;
use crate::tracer::Tracer;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Vertical field of view from outside, degrees: little perspective, as of a model on a table.
const OPEN_FOV: f32 = 35.0;

/// Vertical field of view inside, degrees: wide, since walls allow no step back.
const INTERIOR_FOV: f32 = 70.0;

/// From the scene to the camera outside: three quarters, from 30 degrees above.
const OPEN_DIRECTION: Vec3 = Vec3::new(0.5, 0.5, 0.71);

/// Room around the scene, as a factor on the distance.
const OPEN_MARGIN: f32 = 1.02;

/// Fits of the camera outside: the second leaves it a tenth of the first's shift off the middle, the fourth nothing.
const N_FITS: usize = 4;

/// Share of rays from the middle that end on fronts, of all times of those near the horizon, from which on a scene is an
/// interior. A closed room has 0.8 to 1, a yard between walls a third as high as wide 0.75, a street in a town 0.6.
const INTERIOR_SHARE: f32 = 0.7;

/// Rays from each point asked.
const N_RAYS: u32 = 64;

/// A camera for pictures of `aspect` (width / height) that shows the scene.
pub fn frame(tracer: &Tracer, aspect: f32) -> Camera {
    let (low, high) = bounds(tracer.surface().position);
    if is_interior(tracer, low, high) {
        inside(tracer, low, high, aspect)
    } else {
        outside(tracer, low, high, aspect)
    }
}

fn bounds(position: &[Vec3]) -> (Vec3, Vec3) {
    position.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
}

fn outside(tracer: &Tracer, low: Vec3, high: Vec3, aspect: f32) -> Camera {
    let back = OPEN_DIRECTION.normalize();
    let right = Vec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let tan = (0.5 * OPEN_FOV.to_radians()).tan();
    let position = tracer.surface().position;

    // Fit, then move what is seen to the middle of the picture, which perspective shifts, and fit again.
    let mut target = 0.5 * (low + high);
    let mut distance = 0.0;
    for _ in 0..N_FITS {
        // How far back each vertex sends the camera to be inside both pairs of edges.
        let needs = |p: &Vec3| {
            let q = *p - target;
            let (x, y) = (q.dot(right).abs() / (tan * aspect), q.dot(up).abs() / tan);
            q.dot(back) + x.max(y)
        };
        distance = OPEN_MARGIN * position.iter().map(needs).fold(f32::MIN_POSITIVE, f32::max);
        let eye = target + distance * back;
        let seen = |p: &Vec3| {
            let q = *p - eye;
            Vec3::new(q.dot(right), q.dot(up), 0.0) / -q.dot(back)
        };
        let (left_low, right_high) = position
            .iter()
            .map(seen)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let middle = 0.5 * distance * (left_low + right_high);
        target += middle.x * right + middle.y * up;
    }
    // The last move is a small part of the margin.
    Camera::new(target + distance * back, target, OPEN_FOV)
}

/// Asks from the middle and from four places around it, since one may be inside a column. Rays near the horizon count
/// twice over: a yard has walls all around, a town has streets.
fn is_interior(tracer: &Tracer, low: Vec3, high: Vec3) -> bool {
    const PLACES: [(f32, f32); 5] = [(0.5, 0.5), (0.4, 0.45), (0.6, 0.45), (0.45, 0.6), (0.55, 0.4)];
    // Sine of 20 degrees.
    const NEAR_HORIZON: f32 = 0.34;
    let share = |counts: fn(f32) -> bool| {
        let directions: Vec<Vec3> = (0..N_RAYS).map(spiral).filter(|d| counts(d.y)).collect();
        let from = PLACES.map(|(x, z)| low + Vec3::new(x, 0.5, z) * (high - low));
        let rays = from.iter().flat_map(|from| directions.iter().map(|d| (*from, *d)));
        let n_fronts =
            rays.filter(|(from, d)| tracer.first_contact(*from, *d).is_some_and(|c| c.is_front)).count();
        n_fronts as f32 / (directions.len() * PLACES.len()) as f32
    };
    share(|_| true) * share(|y| y.abs() < NEAR_HORIZON) >= INTERIOR_SHARE
}

/// Directions evenly over the sphere: a Fibonacci spiral.
fn spiral(i: u32) -> Vec3 {
    let y = 1.0 - (2 * i + 1) as f32 / N_RAYS as f32;
    let r = (1.0 - y * y).sqrt();
    // The golden angle.
    let (sin, cos) = (i as f32 * PI * (3.0 - 5.0f32.sqrt()) % TAU).sin_cos();
    Vec3::new(r * cos, y, r * sin)
}

fn inside(tracer: &Tracer, low: Vec3, high: Vec3, aspect: f32) -> Camera {
    const ALONG: [f32; 8] = [0.1, 0.2, 0.32, 0.45, 0.55, 0.68, 0.8, 0.9];
    const HEIGHTS: [f32; 3] = [0.15, 0.3, 0.45];
    let place = |share: Vec3| low + share * (high - low);
    let mut best =
        (f32::NEG_INFINITY, Camera::new(place(Vec3::splat(0.2)), place(Vec3::splat(0.5)), INTERIOR_FOV));
    for (x, z) in ALONG.iter().flat_map(|x| ALONG.map(|z| (*x, z))) {
        // Only along the walls: the farthest view is from there.
        if (x - 0.5).abs().max((z - 0.5).abs()) < 0.25 {
            continue;
        }
        for y in HEIGHTS {
            // Through the middle of the floor plan, a little up: rooms are higher than eyes.
            let target = place(Vec3::new(0.5, 0.8 * y + 0.1, 0.5));
            let camera = Camera::new(place(Vec3::new(x, y, z)), target, INTERIOR_FOV);
            let score = openness(tracer, &camera, aspect, low.distance(high));
            if score > best.0 {
                best = (score, camera);
            }
        }
    }
    best.1
}

/// Mean distance seen, in units of the scene's `size`. What is right before the camera, or seen from behind, or not
/// there, spoils the view.
fn openness(tracer: &Tracer, camera: &Camera, aspect: f32, size: f32) -> f32 {
    const ROWS: usize = 8;
    const TOO_NEAR: f32 = 0.04;
    // What stands in the middle third is more in the way than what frames the picture.
    const CENTRAL: f32 = 3.0;
    let columns = ((ROWS as f32 * aspect).round() as usize).clamp(1, 64);
    let Ok(view) = camera.view(columns, ROWS) else { return f32::NEG_INFINITY };
    let seen = |i: usize| {
        let d = view.direction((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5);
        let open = match tracer.first_contact(camera.eye, d) {
            None => 0.0,
            Some(contact) => {
                let distance = contact.position.distance(camera.eye) / size;
                if contact.is_front && distance > TOO_NEAR { distance } else { -0.5 }
            }
        };
        let is_central = (columns / 3..columns - columns / 3).contains(&(i % columns));
        if is_central { CENTRAL * open } else { open }
    };
    (0..columns * ROWS).map(seen).sum::<f32>() / (columns * ROWS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::test_scenes::{Geometry, closed_box, floor_with_block};

    fn with_tracer<T>(geometry: &Geometry, look: impl FnOnce(&Tracer) -> T) -> T {
        look(&Tracer::new(geometry.surface()).unwrap())
    }

    #[test]
    fn open_scene_fits_the_picture_tightly() {
        for aspect in [0.5, 1.0, 1.78] {
            let geometry = floor_with_block();
            let camera = with_tracer(&geometry, |tracer| frame(tracer, aspect));
            assert!(camera.eye.y > geometry.position.iter().map(|p| p.y).fold(0.0, f32::max));
            let back = (camera.eye - camera.target).normalize();
            let right = Vec3::Y.cross(back).normalize();
            let tan = (0.5 * camera.fov_degrees.to_radians()).tan();
            let edge = |p: &Vec3| {
                let q = *p - camera.eye;
                let depth = -q.dot(back);
                (q.dot(right) / (depth * tan * aspect))
                    .abs()
                    .max((q.dot(back.cross(right)) / (depth * tan)).abs())
            };
            let widest = geometry.position.iter().map(edge).fold(0.0, f32::max);
            assert!(widest < 1.0 && widest > 0.95, "aspect {aspect}: {widest}");
        }
    }

    #[test]
    fn interior_is_seen_from_inside() {
        let geometry = closed_box(Vec3::new(6.0, 3.0, 10.0));
        let camera = with_tracer(&geometry, |tracer| frame(tracer, 1.5));
        let (low, high) = bounds(&geometry.position);
        assert!(camera.eye.cmpgt(low).all() && camera.eye.cmplt(high).all(), "{camera:?}");
        assert_eq!(camera.fov_degrees, INTERIOR_FOV);
        // Across the longer way.
        assert!((camera.eye - camera.target).z.abs() > 2.5, "{camera:?}");
    }

    #[test]
    fn closed_box_with_outward_normals_is_seen_from_outside() {
        let mut geometry = closed_box(Vec3::splat(2.0));
        geometry.normal.iter_mut().for_each(|n| *n = -*n);
        let camera = with_tracer(&geometry, |tracer| frame(tracer, 1.0));
        assert!(camera.eye.length() > 2.0, "{camera:?}");
    }
}
