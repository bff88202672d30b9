//! A pinhole camera.
//!
//! The direction through the point (x, y) of the picture, x from -1 at its left to 1 at its right edge, y from -1 at
//! the lower to 1 at the upper: `forward + tan(fov / 2) (aspect x right + y up)`, normalised.

use crate::error::Error;
use crate::image_file::MOST_PIXELS;
use glam::{Vec2, Vec3};
use std::str::FromStr;

/// Where to look from. Parses from `x,y,z;x,y,z;degrees`: eye, target, vertical field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where the camera is, metres.
    pub eye: Vec3,
    /// A point in the middle of the picture, metres; not the eye.
    pub target: Vec3,
    /// Vertical field of view, degrees, above 0 and below 180.
    pub fov_degrees: f32,
    /// What is up in the picture; any length. Where it is along the view, another direction is taken.
    pub up: Vec3,
}

/// A camera and a picture's size, made ready for many rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub eye: Vec3,
    forward: Vec3,
    /// From the middle of the picture to its right edge, at distance 1.
    right: Vec3,
    /// From the middle of the picture to its upper edge, at distance 1.
    up: Vec3,
    width: f32,
    height: f32,
}

impl Camera {
    /// A camera with +Y up.
    pub fn new(eye: Vec3, target: Vec3, fov_degrees: f32) -> Camera {
        Camera { eye, target, fov_degrees, up: Vec3::Y }
    }

    /// # Errors
    /// [`Error::Options`] for a camera that has no direction, or a picture without pixels or with too many.
    pub(crate) fn view(&self, width: usize, height: usize) -> Result<View, Error> {
        let forward = (self.target - self.eye).try_normalize();
        let fov_fits = self.fov_degrees > 0.0 && self.fov_degrees < 180.0;
        let size_fits = (1..=MOST_PIXELS).contains(&width.saturating_mul(height));
        let (Some(forward), true, true, true) = (forward, fov_fits, self.eye.is_finite(), size_fits) else {
            let what = format!("cannot take a picture of {width} x {height} pixels with {self:?}");
            return Err(Error::Options { what });
        };
        let right =
            forward.cross(self.up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let half = (0.5 * self.fov_degrees.to_radians()).tan();
        Ok(View {
            eye: self.eye,
            forward,
            right: right * half * width as f32 / height as f32,
            up: right.cross(forward) * half,
            width: width as f32,
            height: height as f32,
        })
    }
}

impl View {
    /// Unit direction through a point in pixels from the picture's upper left corner.
    pub fn direction(&self, x: f32, y: f32) -> Vec3 {
        let (x, y) = (2.0 * x / self.width - 1.0, 1.0 - 2.0 * y / self.height);
        (self.forward + x * self.right + y * self.up).normalize()
    }

    /// Of the pixel in this unit direction, steradians.
    pub fn pixel_solid_angle(&self, d: Vec3) -> f32 {
        let in_the_middle = 4.0 * self.right.length() * self.up.length() / (self.width * self.height);
        in_the_middle * self.forward.dot(d).powi(3)
    }

    /// How far in front of the eye a point is, along the middle of the view, metres.
    pub fn depth(&self, p: Vec3) -> f32 {
        (p - self.eye).dot(self.forward)
    }

    /// Where a point in front of the eye is seen, in pixels from the picture's upper left corner.
    pub fn project(&self, p: Vec3) -> Vec2 {
        let q = (p - self.eye) / self.depth(p);
        let (x, y) =
            (q.dot(self.right) / self.right.length_squared(), q.dot(self.up) / self.up.length_squared());
        0.5 * Vec2::new((1.0 + x) * self.width, (1.0 - y) * self.height)
    }
}

impl FromStr for Camera {
    type Err = Error;

    fn from_str(text: &str) -> Result<Camera, Error> {
        let wrong = |at: usize, what: &str| Error::Camera { text: text.into(), at, what: what.into() };
        let parts = fields(text, 0, ';');
        let [eye, target, fov] = parts.as_slice() else {
            let what =
                format!("expected 'eye;target;fov' as x,y,z;x,y,z;degrees, found {} part(s)", parts.len());
            return Err(wrong(text.len(), &what));
        };
        let point = |name: &str, (at, part): (usize, &str)| -> Result<Vec3, Error> {
            let numbers = fields(part, at, ',');
            if numbers.len() != 3 {
                return Err(wrong(
                    at,
                    &format!("{name}: expected three numbers x,y,z, found {}", numbers.len()),
                ));
            }
            let mut p = [0.0; 3];
            for (p, (at, number)) in p.iter_mut().zip(numbers) {
                *p = finite(number).ok_or_else(|| wrong(at, &format!("{name}: expected a number")))?;
            }
            Ok(p.into())
        };
        let camera = Camera::new(
            point("eye", *eye)?,
            point("target", *target)?,
            finite(fov.1).ok_or_else(|| wrong(fov.0, "field of view: expected a number of degrees"))?,
        );
        if !(camera.fov_degrees > 0.0 && camera.fov_degrees < 180.0) {
            return Err(wrong(fov.0, "field of view: must be above 0 and below 180 degrees"));
        }
        if (camera.target - camera.eye).try_normalize().is_none() {
            return Err(wrong(target.0, "target: must not be the eye"));
        }
        Ok(camera)
    }
}

/// Parts between separators, each with the byte at which it begins.
fn fields(text: &str, start: usize, separator: char) -> Vec<(usize, &str)> {
    let mut at = start;
    text.split(separator)
        .map(|part| {
            let field = (at, part);
            at += part.len() + separator.len_utf8();
            field
        })
        .collect()
}

fn finite(text: &str) -> Option<f32> {
    text.trim().parse::<f32>().ok().filter(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn camera_parses() {
        let camera: Camera = "1,2,-3.5; 0,0,1e1 ;45".parse().unwrap();
        let expected = Camera::new(Vec3::new(1.0, 2.0, -3.5), Vec3::new(0.0, 0.0, 10.0), 45.0);
        assert_eq!(camera, expected);
    }

    #[test]
    fn camera_errors_point_at_the_place() {
        for (text, character) in [
            ("", 1),
            ("1,2,3", 6),
            ("1,2;0,0,0;50", 1),
            ("1,2,x;0,0,0;50", 5),
            ("1,2,3;0,nan,0;50", 9),
            ("1,2,3;0,0,0,0;50", 7),
            ("1,2,3;0,0,0;", 13),
            ("1,2,3;0,0,0;180", 13),
            ("1,2,3;0,0,0;-5", 13),
            ("1,2,3;1,2,3;50", 7),
            ("ü,2,3;0,0,0;50", 1),
            ("1,ü,ü;0,0,0;5", 3),
        ] {
            let message = text.parse::<Camera>().unwrap_err().to_string();
            assert!(message.contains(&format!("character {character}:")), "{text}: {message}");
            assert_eq!(message.lines().count(), 1);
        }
    }

    #[test]
    fn view_spans_the_field_of_view() {
        let camera = Camera::new(Vec3::ZERO, -Vec3::Z, 90.0);
        let view = camera.view(200, 100).unwrap();
        // Right is +X, up is +Y; the edges lie 45 degrees off, the sides at twice that tangent.
        let close = |a: Vec3, b: Vec3| a.distance(b.normalize()) < 1e-6;
        assert!(close(view.direction(100.0, 50.0), Vec3::new(0.0, 0.0, -1.0)));
        assert!(close(view.direction(100.0, 0.0), Vec3::new(0.0, 1.0, -1.0)));
        assert!(close(view.direction(200.0, 50.0), Vec3::new(2.0, 0.0, -1.0)));
    }

    #[test]
    fn view_straight_down_is_finite() {
        let view = Camera::new(Vec3::Y, Vec3::ZERO, 60.0).view(4, 4).unwrap();
        assert!(view.direction(0.0, 0.0).is_finite() && view.direction(2.0, 2.0).y < -0.99);
        assert!(Camera::new(Vec3::Y, Vec3::Y, 60.0).view(4, 4).is_err());
        for size in [(0, 4), (usize::MAX, 2), (1 << 20, 1 << 20)] {
            assert!(Camera::new(Vec3::Y, Vec3::ZERO, 60.0).view(size.0, size.1).is_err());
        }
    }
}
