//! Lines in space drawn into a picture, as through glass: nothing hides them.
//!
//! A line is cut at a plane just in front of the eye, its ends are projected as [`Camera`] projects, and what is
//! between them is drawn a few pixels wide, with edges shaded by the share of a pixel that they cover.

use crate::camera::{Camera, View};
use crate::error::Error;
use crate::image::Picture;
use glam::{Vec2, Vec3};

/// Nearest that a line is drawn, as a share of the distance from eye to target.
const NEAREST: f32 = 1e-3;

/// Half the width of a line, pixels.
const HALF_WIDTH: f32 = 1.25;

/// Draws segments, metres, in one sRGB colour.
///
/// # Errors
/// [`Error::Options`] if the camera has no direction or the picture no pixels.
pub fn draw_outlines(
    picture: &mut Picture,
    camera: &Camera,
    outlines: &[[Vec3; 2]],
    colour: [u8; 3],
) -> Result<(), Error> {
    let view = camera.view(picture.width, picture.height)?;
    let nearest = NEAREST * camera.eye.distance(camera.target);
    for line in outlines {
        if let Some([a, b]) = in_front(&view, *line, nearest) {
            draw(picture, view.project(a), view.project(b), colour);
        }
    }
    Ok(())
}

/// What of a line is in front of the eye.
fn in_front(view: &View, [a, b]: [Vec3; 2], nearest: f32) -> Option<[Vec3; 2]> {
    let (da, db) = (view.depth(a) - nearest, view.depth(b) - nearest);
    let cut = || a.lerp(b, da / (da - db));
    match (da > 0.0, db > 0.0) {
        (true, true) => Some([a, b]),
        (true, false) => Some([a, cut()]),
        (false, true) => Some([cut(), b]),
        (false, false) => None,
    }
}

fn draw(picture: &mut Picture, a: Vec2, b: Vec2, colour: [u8; 3]) {
    let size = Vec2::new(picture.width as f32, picture.height as f32);
    let Some((a, b)) = clipped(a, b, -Vec2::splat(4.0), size + 4.0) else { return };
    let reach = HALF_WIDTH + 1.0;
    let (low, high) = (a.min(b) - reach, a.max(b) + reach);
    let range = |low: f32, high: f32, n: usize| low.max(0.0) as usize..(high.max(0.0).ceil() as usize).min(n);
    for y in range(low.y, high.y, picture.height) {
        for x in range(low.x, high.x, picture.width) {
            let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let covered = (HALF_WIDTH + 0.5 - distance(middle, a, b)).clamp(0.0, 1.0);
            let pixel = &mut picture.pixels[y * picture.width + x];
            for (p, c) in pixel.iter_mut().zip(colour) {
                *p = (f32::from(*p) + covered * (f32::from(c) - f32::from(*p))).round() as u8;
            }
        }
    }
}

fn distance(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let way = b - a;
    let t = ((p - a).dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(a + t * way)
}

/// What of a line is within a rectangle.
///
/// Based on: Liang & Barsky, A New Concept and Method for Line Clipping, 1984.
fn clipped(a: Vec2, b: Vec2, low: Vec2, high: Vec2) -> Option<(Vec2, Vec2)> {
    let way = b - a;
    let (mut from, mut to) = (0.0f32, 1.0f32);
    for axis in 0..2 {
        if way[axis] == 0.0 {
            if a[axis] < low[axis] || a[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let (s, t) = ((low[axis] - a[axis]) / way[axis], (high[axis] - a[axis]) / way[axis]);
        from = from.max(s.min(t));
        to = to.min(s.max(t));
    }
    (from <= to).then(|| (a + from * way, a + to * way))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [255, 0, 0];

    fn black() -> Picture {
        Picture { width: 100, height: 50, pixels: vec![[0; 3]; 5000] }
    }

    fn camera() -> Camera {
        Camera::new(Vec3::ZERO, -Vec3::Z, 90.0)
    }

    #[test]
    fn line_is_where_the_camera_sees_it() {
        // At distance 1 the picture spans y from -1 to 1 over 50 pixels: y = 0.5 is row 12.5, x = 0.5 column 62.5.
        let mut picture = black();
        let line = [Vec3::new(-0.5, 0.5, -1.0), Vec3::new(0.5, 0.5, -1.0)];
        draw_outlines(&mut picture, &camera(), &[line], RED).unwrap();
        let at = |x: usize, y: usize| picture.pixels[y * 100 + x];
        assert_eq!((at(50, 12), at(40, 12), at(62, 12)), (RED, RED, RED));
        assert_eq!((at(50, 9), at(50, 16), at(66, 12), at(34, 12)), ([0; 3], [0; 3], [0; 3], [0; 3]));
    }

    #[test]
    fn line_that_passes_the_eye_is_cut_there() {
        let mut picture = black();
        let line = [Vec3::new(0.0, -0.5, -1.0), Vec3::new(0.0, -0.5, 5.0)];
        draw_outlines(&mut picture, &camera(), &[line], RED).unwrap();
        // From row 37.5 down to the lower edge, and nothing above.
        let red = |y: usize| picture.pixels[y * 100 + 50] == RED;
        assert!(red(38) && red(49) && !(0..35).any(red));
    }

    #[test]
    fn lines_behind_or_beside_the_picture_leave_it_alone() {
        let mut picture = black();
        let behind = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 2.0)];
        let beside = [Vec3::new(9.0, 0.0, -1.0), Vec3::new(9.0, 1.0, -1.0)];
        let nearly = [Vec3::new(1e30, 0.0, -1e-3), Vec3::new(1e30, 1e30, -1.0)];
        draw_outlines(&mut picture, &camera(), &[behind, beside, nearly], RED).unwrap();
        assert_eq!(picture, black());
    }
}
