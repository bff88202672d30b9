//! A picture that shows where portals are: from inside and from outside, side by side.
//!
//! The scene is drawn as if each eye carried a lamp: albedo times the cosine between surface and view. Portals stand
//! in it as coloured surfaces, with their outlines over everything, so that a hidden one is seen too. The eye inside
//! is the one, of those that back off from each portal along its normal, that sees most portals; the eye outside
//! stands before most of their area, a little above.
//!
//! Where it breaks: a portal that no eye inside sees well shows as an outline only; colours repeat after six.

use glam::Vec3;

use crate::camera::Camera;
use crate::error::Error;
use crate::image::{Exposure, Image, Picture, tone_map};
use crate::outline::draw_outlines;
use crate::tracer::{Surface, Tracer};
use crate::visibility;

/// A window of a portal, to be shown.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The portal's number: windows of one portal have one colour.
    pub portal: usize,
    /// Corners, metres.
    pub triangles: Vec<[Vec3; 3]>,
    /// The edges of its polygons.
    pub outline: Vec<[Vec3; 2]>,
    /// Unit, into the interior.
    pub normal: Vec3,
}

/// One after the other, sRGB: told apart with all kinds of colour vision, after Okabe & Ito, Color Universal Design, 2008.
const COLOURS: [[u8; 3]; 6] =
    [[230, 159, 0], [86, 180, 233], [240, 228, 66], [204, 121, 167], [0, 158, 115], [213, 94, 0]];

/// Of the picture's brightness, what a surface seen edge-on keeps.
const EDGE_ON: f32 = 0.25;

/// What is not there, linear.
const SKY: Vec3 = Vec3::new(0.03, 0.035, 0.05);

/// Vertical fields of view, degrees.
const INSIDE_FOV: f32 = 75.0;
const OUTSIDE_FOV: f32 = 35.0;

/// Portals of less than this share of the largest one's area are not looked for, and of a picture no portal needs more
/// than this.
const LARGE: f32 = 0.2;
const ENOUGH: f32 = 0.015;

/// What the scene itself is worth, where it fills this much of the picture and more: portals alone show nothing.
const SCENE_WORTH: f32 = 0.1;
const SCENE_ENOUGH: f32 = 0.6;

/// Portals, and triangles of each, from which the inside eye backs off; and where on the way to the wall it may stop.
const MOST_ASKED: usize = 16;
const STOPS: [f32; 4] = [0.35, 0.55, 0.75, 0.92];
/// Rays of an eye that is tried: columns and rows.
const TRIED: [usize; 2] = [36, 24];

/// Draws both views of a surface, which is without glass, each `width` / 2 by `height` pixels.
///
/// # Errors
/// [`Error::Surface`] for a surface without triangles, [`Error::Options`] for a picture without pixels,
/// [`Error::Embree`] where Embree is missing.
pub fn show_portals(
    surface: Surface,
    portals: &[Shown],
    (width, height): (usize, usize),
) -> Result<Picture, Error> {
    let all = Joined::new(surface, portals);
    let tracer = Tracer::new(all.surface())?;
    let size = (width / 2, height);
    let inside = inside(&tracer, &all, portals, size);
    let left = view(&tracer, &all, portals, &inside, size)?;
    let right = view(&tracer, &all, portals, &outside(portals, size), size)?;
    Ok(beside(&left, &right))
}

/// The scene and its portals as one mesh.
struct Joined {
    position: Vec<Vec3>,
    normal: Vec<Vec3>,
    index: Vec<[u32; 3]>,
    albedo: Vec<Vec3>,
    /// Vertices and triangles of the scene alone.
    n_vertices: usize,
    n_triangles: u32,
    /// By triangle from there on.
    portal_of: Vec<usize>,
}

impl Joined {
    fn new(scene: Surface, portals: &[Shown]) -> Joined {
        let mut all = Joined {
            position: scene.position.to_vec(),
            normal: scene.normal.to_vec(),
            index: scene.index.to_vec(),
            albedo: scene.albedo.to_vec(),
            n_vertices: scene.position.len(),
            n_triangles: scene.index.len() as u32,
            portal_of: Vec::new(),
        };
        for (k, portal) in portals.iter().enumerate() {
            let colour = colour(portal).map(linear);
            for triangle in &portal.triangles {
                let first = all.position.len() as u32;
                all.position.extend(triangle);
                all.normal.extend([portal.normal; 3]);
                all.albedo.extend([Vec3::from(colour); 3]);
                all.index.push([first, first + 1, first + 2]);
                all.portal_of.push(k);
            }
        }
        all
    }

    fn surface(&self) -> Surface<'_> {
        Surface { position: &self.position, normal: &self.normal, index: &self.index, albedo: &self.albedo }
    }

    /// The window that a triangle is of.
    fn portal(&self, triangle: u32) -> Option<usize> {
        triangle.checked_sub(self.n_triangles).map(|t| self.portal_of[t as usize])
    }

    /// What each vertex sends to an eye.
    fn radiance(&self, eye: Vec3) -> Vec<Vec3> {
        let vertex = |v: usize| {
            if v >= self.n_vertices {
                return self.albedo[v];
            }
            let cosine = (eye - self.position[v]).normalize_or_zero().dot(self.normal[v]).abs();
            self.albedo[v].max(Vec3::splat(0.05)) * (EDGE_ON + (1.0 - EDGE_ON) * cosine)
        };
        (0..self.position.len()).map(vertex).collect()
    }
}

fn colour(shown: &Shown) -> [u8; 3] {
    COLOURS[shown.portal % COLOURS.len()]
}

/// sRGB to linear.
fn linear(value: u8) -> f32 {
    let x = f32::from(value) / 255.0;
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

fn view(
    tracer: &Tracer,
    all: &Joined,
    portals: &[Shown],
    camera: &Camera,
    (width, height): (usize, usize),
) -> Result<Picture, Error> {
    let seen = visibility::trace(tracer, camera, width, height)?;
    let image: Image = seen.shade(&all.surface(), &all.radiance(camera.eye), |_| SKY)?;
    let mut picture = tone_map(&image, Exposure::Stops(0.0));
    for portal in portals {
        draw_outlines(&mut picture, camera, &portal.outline, colour(portal))?;
    }
    Ok(picture)
}

/// The eye inside that sees most large portals, each counted by its share of the picture up to [`ENOUGH`].
fn inside(tracer: &Tracer, all: &Joined, portals: &[Shown], (width, height): (usize, usize)) -> Camera {
    let largest = portals.iter().map(Shown::area).fold(0.0, f32::max);
    let is_large: Vec<bool> = portals.iter().map(|p| p.area() >= LARGE * largest).collect();
    let mut best = (f32::NEG_INFINITY, outside(portals, (width, height)));
    for (portal, _) in portals.iter().zip(&is_large).filter(|(_, large)| **large).take(MOST_ASKED) {
        for camera in backing_off(tracer, portal) {
            let score = score(tracer, all, &is_large, &camera);
            if score > best.0 {
                best = (score, camera);
            }
        }
    }
    best.1
}

/// Eyes between a portal's largest triangles and what is across of them, looking at it: straight, and aslant.
fn backing_off(tracer: &Tracer, portal: &Shown) -> Vec<Camera> {
    let mut largest: Vec<&[Vec3; 3]> = portal.triangles.iter().collect();
    largest.sort_by(|a, b| cross(b).length().total_cmp(&cross(a).length()));
    let every = largest.len().div_ceil(MOST_ASKED);
    largest.into_iter().step_by(every).flat_map(|t| backing_off_from(tracer, t)).collect()
}

fn backing_off_from(tracer: &Tracer, triangle: &[Vec3; 3]) -> Vec<Camera> {
    let from = triangle.iter().sum::<Vec3>() / 3.0;
    let normal = cross(triangle).normalize_or_zero();
    let side = normal.any_orthonormal_vector();
    let up = normal.cross(side);
    let aslant = [Vec3::ZERO, side, -side, up, -up].map(|s| (normal + 0.8 * s).normalize());
    let camera = |d: Vec3| {
        let wall = tracer.first_contact(tracer.lift(from, normal), d)?.position;
        Some(STOPS.map(|s| Camera::new(from.lerp(wall, s), from, INSIDE_FOV)))
    };
    aslant.into_iter().filter_map(camera).flatten().collect()
}

fn score(tracer: &Tracer, all: &Joined, is_large: &[bool], camera: &Camera) -> f32 {
    let [columns, rows] = TRIED;
    let Ok(view) = camera.view(columns, rows) else { return f32::NEG_INFINITY };
    let (mut share, mut scene) = (vec![0.0; is_large.len()], 0.0);
    let ray = 1.0 / (columns * rows) as f32;
    for i in 0..columns * rows {
        let d = view.direction((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5);
        let Some(contact) = tracer.first_contact(camera.eye, d) else { continue };
        match all.portal(contact.triangle) {
            Some(k) => share[k] += ray,
            None => scene += ray,
        }
    }
    let large = share.iter().zip(is_large).filter(|(_, large)| **large);
    large.map(|(s, _)| s.min(ENOUGH)).sum::<f32>() + SCENE_WORTH * f32::min(scene, SCENE_ENOUGH)
}

/// Before the side of the portals that has most area, from a little above, with all of them in the picture.
fn outside(portals: &[Shown], (width, height): (usize, usize)) -> Camera {
    let corners = || portals.iter().flat_map(|p| p.triangles.iter().flatten().copied());
    let (low, high) =
        corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let largest = portals.iter().max_by(|a, b| a.area().total_cmp(&b.area()));
    let back = -largest.map_or(Vec3::Z, |p| p.normal);
    let side = back.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::Z);
    let direction = (back + 0.35 * side + 0.5 * Vec3::Y).normalize();
    let aspect = width as f32 / height as f32;
    let tan = (0.5 * OUTSIDE_FOV.to_radians()).tan();
    let radius = 0.5 * low.distance(high);
    // A sphere around the portals, and half as much again around them.
    let distance = 1.5 * radius / (tan * aspect.min(1.0));
    let target = 0.5 * (low + high);
    Camera::new(target + distance * direction, target, OUTSIDE_FOV)
}

impl Shown {
    fn area(&self) -> f32 {
        self.triangles.iter().map(|t| 0.5 * cross(t).length()).sum()
    }
}

fn cross([a, b, c]: &[Vec3; 3]) -> Vec3 {
    (*b - *a).cross(*c - *a)
}

fn beside(left: &Picture, right: &Picture) -> Picture {
    let width = left.width + right.width;
    let rows = left.pixels.chunks(left.width).zip(right.pixels.chunks(right.width));
    let pixels = rows.flat_map(|(l, r)| l.iter().chain(r).copied()).collect();
    Picture { width, height: left.height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::test_scenes::closed_box;

    /// Pixels of a colour, within what tone mapping takes off, in each half.
    fn n_coloured(picture: &Picture, colour: [u8; 3]) -> [usize; 2] {
        let near = |p: &&[u8; 3]| p.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 24);
        let rows = || picture.pixels.chunks(picture.width);
        let half = picture.width / 2;
        [
            rows().map(|row| row[..half].iter().filter(near).count()).sum(),
            rows().map(|row| row[half..].iter().filter(near).count()).sum(),
        ]
    }

    #[test]
    fn window_is_seen_from_inside_and_through_its_wall() {
        let room = closed_box(Vec3::new(4.0, 3.0, 5.0));
        // Just inside of the wall, so that from outside only its outline shows.
        let corner = |x: f32, y: f32| Vec3::new(x, y, 2.49);
        let [a, b, c, d] = [corner(-0.6, -0.5), corner(-0.6, 0.5), corner(0.6, 0.5), corner(0.6, -0.5)];
        let window = Shown {
            portal: 1,
            triangles: vec![[a, b, c], [a, c, d]],
            outline: vec![[a, b], [b, c], [c, d], [d, a]],
            normal: -Vec3::Z,
        };
        let picture = show_portals(room.surface(), std::slice::from_ref(&window), (240, 100)).unwrap();
        assert_eq!((picture.width, picture.height), (240, 100));
        let [inside, outside] = n_coloured(&picture, COLOURS[1]);
        // Enough of a picture, and all of it lines of two or three pixels around what is a good part of the other.
        assert!(inside as f32 > ENOUGH * 12000.0, "{inside}");
        assert!(outside > 60 && outside < 2000, "{outside}");
        assert_eq!(n_coloured(&picture, COLOURS[0]), [0, 0]);
    }

    #[test]
    fn picture_without_pixels_is_refused() {
        let room = closed_box(Vec3::ONE);
        assert!(show_portals(room.surface(), &[], (0, 10)).is_err());
    }
}
