//! What each pixel sees, traced once and shaded as often as the light changes.
//!
//! 16 rays per pixel, one in each cell of a 4 x 4 grid at a random place in it, box filtered. Radiance is interpolated
//! over a triangle linearly, so that all rays of a pixel that hit one triangle are one *share*: a weight for each of
//! its three vertices. What sees no surface is kept as up to four directions, the means over the quarters of a pixel.
//! A frame then is a sum over shares, without a ray.
//!
//! Surfaces are two-sided: both sides show the radiance of their vertices.

use crate::camera::{Camera, View};
use crate::error::Error;
use crate::image::Image;
use crate::reference::hash;
use crate::tracer::{Surface, Tracer, lambert};
use glam::{Vec2, Vec3};
use lunette_ffi::{Hits, Mask, NO_HIT, Packet, Ray};
use lunette_relight::glossy::Glossy;
use lunette_relight::portal_frame::{Detail, Point, PortalFrame};
use rayon::prelude::*;

/// Rays per side of a pixel's grid.
const GRID: usize = 4;

/// Rays per pixel: one packet.
const SAMPLES: usize = GRID * GRID;

/// Pixels per side of a tile, traced by one thread: neighbours ask for the same parts of the search tree.
const TILE: usize = 16;

/// Shares that one thread asks about at least in a row.
const LEAST_SHARES: usize = 512;

/// Stands for a triangle where a share sees the background.
const BACKGROUND: u32 = u32::MAX;

/// What each pixel of a picture sees.
#[derive(Clone, Debug)]
pub struct Visibility {
    width: usize,
    height: usize,
    view: View,
    /// Pixel p has the shares start\[p\]..start\[p + 1\].
    start: Vec<u32>,
    shares: Vec<Share>,
}

/// A part of a pixel that sees one triangle or a piece of background.
#[derive(Clone, Copy, Debug)]
struct Share {
    triangle: u32,
    /// Part of the pixel, 0..=1.
    weight: f32,
    /// Weights of the triangle's second and third vertex, times `weight`; of background, its place in the picture in
    /// pixels, times `weight`.
    inner: Vec2,
}

/// Traces a picture of `width` x `height` pixels.
///
/// # Errors
/// [`Error::Options`] for a camera without direction or a picture without pixels.
pub fn trace(tracer: &Tracer, camera: &Camera, width: usize, height: usize) -> Result<Visibility, Error> {
    let view = camera.view(width, height)?;
    let mut pixels = for_each_tile(width, height, |x, y| pixel_shares(tracer, &view, x, y));
    let mut start = Vec::with_capacity(pixels.len() + 1);
    let mut shares = Vec::new();
    start.push(0);
    for pixel in &mut pixels {
        shares.append(pixel);
        start.push(shares.len() as u32);
    }
    Ok(Visibility { width, height, view, start, shares })
}

/// Radiance of each vertex under its irradiance: `albedo E / pi`.
///
/// # Panics
/// If the lengths differ.
pub fn vertex_radiance(irradiance: &[Vec3], albedo: &[Vec3]) -> Vec<Vec3> {
    assert_eq!(irradiance.len(), albedo.len(), "one albedo per vertex");
    irradiance.iter().zip(albedo).map(|(e, albedo)| lambert(*albedo, *e)).collect()
}

/// What a picture is lit through.
#[derive(Clone, Copy)]
pub struct Through<'a> {
    /// As its portals are lit.
    pub frame: &'a PortalFrame<'a>,
    /// After [`Glossy::project`] of that frame, where there is something glossy.
    pub glossy: Option<&'a Glossy<'a>>,
}

impl Visibility {
    /// The picture for one radiance per vertex \[V\], over a background of `background(direction)`.
    ///
    /// # Errors
    /// [`Error::Options`] where `radiance` is not one per vertex of the surface that was traced.
    pub fn shade(
        &self,
        surface: &Surface,
        radiance: &[Vec3],
        background: impl Fn(Vec3) -> Vec3 + Sync,
    ) -> Result<Image, Error> {
        self.shade_through(None, surface, radiance, background)
    }

    /// As [`shade`](Self::shade), through these portals: suns are as sharp as [`Detail`] has them on the triangles of their
    /// asset, whose vertices come first; and lobes of glossy vertices, which `radiance` then lacks, are those of each point.
    ///
    /// # Errors
    /// As [`shade`](Self::shade).
    pub fn shade_through(
        &self,
        through: Option<Through>,
        surface: &Surface,
        radiance: &[Vec3],
        background: impl Fn(Vec3) -> Vec3 + Sync,
    ) -> Result<Image, Error> {
        if radiance.len() != surface.position.len() {
            let (found, expected) = (radiance.len(), surface.position.len());
            return Err(Error::Options {
                what: format!("picture: {found} radiances for {expected} vertices"),
            });
        }
        let more = through.map_or_else(Vec::new, |through| self.more(through, surface));
        let shade = |(i, share): (usize, &Share)| match share.triangle {
            BACKGROUND => share.weight * background(self.direction(share)),
            triangle => {
                let [a, b, c] = surface.index[triangle as usize].map(|v| radiance[v as usize]);
                let of_pixel = share.weights().map(|weight| share.weight * weight);
                let plain = mean(of_pixel, [a, b, c]);
                match more.get(i) {
                    Some((irradiance, radiance)) if (*irradiance, *radiance) != Default::default() => {
                        let albedo = surface.index[triangle as usize].map(|v| surface.albedo[v as usize]);
                        let diffuse = lambert(mean(of_pixel, albedo), *irradiance);
                        (plain + diffuse + share.weight * *radiance).max(Vec3::ZERO)
                    }
                    _ => plain,
                }
            }
        };
        let pixels = self.start.par_windows(2).map(|s| {
            let range = s[0] as usize..s[1] as usize;
            range.clone().zip(&self.shares[range]).map(shade).sum()
        });
        Ok(Image { width: self.width, height: self.height, pixels: pixels.collect() })
    }

    /// Where it is seen from, metres.
    pub fn eye(&self) -> Vec3 {
        self.view.eye
    }

    /// Part of each pixel that sees a surface, 0..=1: the weight of a comparison that leaves the background out.
    pub fn coverage(&self) -> Vec<f32> {
        let shares = self.start.windows(2).map(|s| &self.shares[s[0] as usize..s[1] as usize]);
        shares.map(|s| s.iter().filter(|s| s.triangle != BACKGROUND).map(|s| s.weight).sum()).collect()
    }

    /// Irradiance, and radiance of lobes, that shares have beyond what is interpolated, asked for triangle after triangle.
    fn more(&self, Through { frame, glossy }: Through, surface: &Surface) -> Vec<(Vec3, Vec3)> {
        let is_of_asset = |share: &Share| {
            let corners = surface.index.get(share.triangle as usize);
            corners.is_some_and(|c| c.iter().all(|v| (*v as usize) < frame.n_vertices()))
        };
        let mut order: Vec<u32> =
            (0..self.shares.len() as u32).filter(|&i| is_of_asset(&self.shares[i as usize])).collect();
        order.par_sort_unstable_by_key(|&i| (self.shares[i as usize].triangle, i));
        let eye = self.view.eye.to_array();
        let found: Vec<([f32; 3], [f32; 3])> = order
            .par_iter()
            .with_min_len(LEAST_SHARES)
            .map_init(
                || Detail::new(frame),
                |detail, &i| {
                    let point = self.point(surface, &self.shares[i as usize]);
                    let radiance = glossy.map_or([0.0; 3], |g| g.radiance_at(eye, &point, detail));
                    (detail.at(&point), radiance)
                },
            )
            .collect();
        let mut all = vec![Default::default(); self.shares.len()];
        for (i, (irradiance, radiance)) in order.into_iter().zip(found) {
            all[i as usize] = (irradiance.into(), radiance.into());
        }
        all
    }

    /// The middle of what a share sees of its triangle, and a disc as large as that.
    fn point(&self, surface: &Surface, share: &Share) -> Point {
        let (corners, weights) = (surface.index[share.triangle as usize], share.weights());
        let [a, b, c] = corners.map(|v| surface.position[v as usize]);
        let to = mean(weights, [a, b, c]) - self.view.eye;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let way = to.length();
        // Seen edge on, a pixel is long and narrow: a disc of its area would be too wide.
        let slope = (normal.dot(to).abs() / way).max(0.1);
        let area = share.weight * self.view.pixel_solid_angle(to / way) * way * way / slope;
        Point { corners, weights, radius: (area / std::f32::consts::PI).sqrt() }
    }

    fn direction(&self, share: &Share) -> Vec3 {
        let place = share.inner / share.weight;
        self.view.direction(place.x, place.y)
    }
}

impl Share {
    /// Of the triangle's corners; they add up to 1.
    fn weights(&self) -> [f32; 3] {
        let Vec2 { x, y } = self.inner / self.weight;
        [1.0 - x - y, x, y]
    }
}

fn mean(weights: [f32; 3], corners: [Vec3; 3]) -> Vec3 {
    corners.into_iter().zip(weights).map(|(c, weight)| weight * c).sum()
}

/// One value for every pixel, row by row, computed in tiles.
pub(crate) fn for_each_tile<T: Send + Default + Clone>(
    width: usize,
    height: usize,
    pixel: impl Fn(usize, usize) -> T + Sync,
) -> Vec<T> {
    let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let place = |tile: usize, i: usize| (tile % columns * TILE + i % TILE, tile / columns * TILE + i / TILE);
    let tiles: Vec<Vec<T>> = (0..columns * rows)
        .into_par_iter()
        .map(|tile| {
            lunette_ffi::flush_to_zero();
            let places = (0..TILE * TILE).map(|i| place(tile, i)).filter(|&(x, y)| x < width && y < height);
            places.map(|(x, y)| pixel(x, y)).collect()
        })
        .collect();

    let mut out = vec![T::default(); width * height];
    for (tile, values) in tiles.into_iter().enumerate() {
        let places = (0..TILE * TILE).map(|i| place(tile, i)).filter(|&(x, y)| x < width && y < height);
        for ((x, y), value) in places.zip(values) {
            out[y * width + x] = value;
        }
    }
    out
}

fn pixel_shares(tracer: &Tracer, view: &View, x: usize, y: usize) -> Vec<Share> {
    // One ray in every cell of the grid.
    let mut places = [Vec2::ZERO; SAMPLES];
    let mut rays = Packet::<SAMPLES>::default();
    for (i, place) in places.iter_mut().enumerate() {
        let jitter = hash::uniform_2d(hash::mix([x as u32, y as u32, i as u32]));
        let cell = Vec2::new((i % GRID) as f32, (i / GRID) as f32);
        *place = Vec2::new(x as f32, y as f32) + (cell + jitter) / GRID as f32;
        let direction = view.direction(place.x, place.y);
        rays.set(i, &Ray::new(view.eye.to_array(), direction.to_array()));
    }
    let mut hits = Hits::default();
    tracer.scene().intersect_packet(&Mask::all(), &mut rays, &mut hits);

    // Rays of one triangle, and background of one quarter, become one share.
    let mut shares: Vec<(u32, usize, Share)> = Vec::new();
    for (i, place) in places.iter().enumerate() {
        let seen = hits.geometry[i] != NO_HIT;
        let (triangle, quarter, inner) = if seen {
            (hits.primitive[i], 0, Vec2::new(hits.u[i], hits.v[i]))
        } else {
            (BACKGROUND, i % GRID / 2 + i / GRID / 2 * 2, *place)
        };
        let slot = shares.iter().position(|s| (s.0, s.1) == (triangle, quarter)).unwrap_or_else(|| {
            shares.push((triangle, quarter, Share { triangle, weight: 0.0, inner: Vec2::ZERO }));
            shares.len() - 1
        });
        shares[slot].2.weight += 1.0 / SAMPLES as f32;
        shares[slot].2.inner += inner / SAMPLES as f32;
    }
    shares.into_iter().map(|s| s.2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSITION: [Vec3; 4] = [
        Vec3::new(-10.0, 0.0, -10.0),
        Vec3::new(-10.0, 0.0, 10.0),
        Vec3::new(10.0, 0.0, 10.0),
        Vec3::new(10.0, 0.0, -10.0),
    ];

    fn floor() -> Surface<'static> {
        const NORMAL: [Vec3; 4] = [Vec3::Y; 4];
        const ALBEDO: [Vec3; 4] = [Vec3::splat(0.5); 4];
        Surface { position: &POSITION, normal: &NORMAL, index: &[[0, 1, 2], [0, 2, 3]], albedo: &ALBEDO }
    }

    #[test]
    fn shading_is_linear_interpolation_at_the_pixel() {
        let tracer = Tracer::new(floor()).unwrap();
        let camera = Camera::new(Vec3::new(1.0, 8.0, 0.5), Vec3::new(0.0, 0.0, 0.3), 40.0);
        let seen = trace(&tracer, &camera, 33, 20).unwrap();
        assert!(seen.coverage().iter().all(|c| (c - 1.0).abs() < 1e-6));
        // Radiance that is the position itself: a pixel then holds the mean of the points it sees.
        let image = seen.shade(&floor(), &POSITION, |_| Vec3::NAN).unwrap();
        let view = camera.view(33, 20).unwrap();
        for (i, found) in image.pixels.iter().enumerate() {
            let d = view.direction((i % 33) as f32 + 0.5, (i / 33) as f32 + 0.5);
            let expected = camera.eye - d * camera.eye.y / d.y;
            // Pixels are 0.3 m wide; the mean of 16 stratified points is 0.02 m off at one standard deviation.
            assert!(found.distance(expected) < 0.1, "{i}: {found} {expected}");
        }
    }

    #[test]
    fn background_is_seen_along_the_ray() {
        let tracer = Tracer::new(floor()).unwrap();
        let camera = Camera::new(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.3, 4.0, 1.0), 60.0);
        let seen = trace(&tracer, &camera, 16, 12).unwrap();
        assert!(seen.coverage().iter().all(|c| *c == 0.0));
        let image = seen.shade(&floor(), &[Vec3::NAN; 4], |d| d).unwrap();
        let view = camera.view(16, 12).unwrap();
        for (i, found) in image.pixels.iter().enumerate() {
            let d = view.direction((i % 16) as f32 + 0.5, (i / 16) as f32 + 0.5);
            // A pixel is 0.1 rad wide.
            assert!(found.distance(d) < 0.03, "{i}: {found} {d}");
        }
    }

    #[test]
    fn horizon_pixels_mix_floor_and_sky() {
        let tracer = Tracer::new(floor()).unwrap();
        let camera = Camera::new(Vec3::new(0.0, 2.0, 0.0), Vec3::new(0.0, 1.0, -10.0), 60.0);
        let seen = trace(&tracer, &camera, 64, 48).unwrap();
        let image = seen.shade(&floor(), &[Vec3::X; 4], |_| Vec3::Y).unwrap();
        for (pixel, coverage) in image.pixels.iter().zip(seen.coverage()) {
            assert!(pixel.distance(Vec3::new(coverage, 1.0 - coverage, 0.0)) < 1e-5);
        }
        assert!(seen.coverage().iter().any(|c| *c > 0.0 && *c < 1.0));
    }

    #[test]
    fn shading_refuses_another_surface() {
        let tracer = Tracer::new(floor()).unwrap();
        let seen = trace(&tracer, &Camera::new(Vec3::Y, Vec3::ZERO, 60.0), 2, 2).unwrap();
        assert!(seen.shade(&floor(), &[Vec3::ONE; 3], |_| Vec3::ZERO).is_err());
    }

    #[test]
    fn tiles_put_pixels_in_their_place() {
        let found = for_each_tile(37, 19, |x, y| y * 37 + x);
        assert!(found.iter().enumerate().all(|(i, &v)| i == v));
    }
}
