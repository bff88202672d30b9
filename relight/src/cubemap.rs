//! Cubemaps of N x N x 6 texels: where a texel lies, how large it is, which one a direction falls into.
//!
//! Faces +X -X +Y -Y +Z -Z, oriented as in OpenGL; texel t = face N² + row N + column. On a face with axes
//! (a, s, t) the direction of the point (x, y), x along columns and y along rows, both in -1..=1, is a + x s + y t,
//! and the solid angle per dx dy is (1 + x² + y²)^(-3/2). A texel is a box in x and y; its solid angle is the closed
//! form A(x₁, y₁) - A(x₀, y₁) - A(x₁, y₀) + A(x₀, y₀) with A(x, y) = atan2(x y, √(1 + x² + y²)).
//!
//! A light on a cubemap is its *average* radiance over each texel ([`project_light`]), so that a transfer row
//! T\[t\] (sr) and the texels L\[t\] meet in E = Σ T\[t\] L\[t\], with the light's energy kept however small a sun is.
//!
//! Where it breaks: a light finer than a texel (π / 2N radians at the middle of a face) is spread over it.
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic
//! Environment Illumination, 2009 (shells as cubemaps); Ng, Ramamoorthi and Hanrahan, All-Frequency Shadows Using
//! Non-linear Wavelet Lighting Approximation, 2003.

use std::ops::RangeInclusive;

use glam::{Vec2, Vec3};

mod disc;
pub mod footprint;
mod picture;
mod project;
mod sh_table;

pub(crate) use disc::add_disc;
pub(crate) use picture::accumulate as accumulate_picture;
pub use project::project_light;
#[cfg(feature = "rayon")]
pub use project::project_light_parallel;
pub use sh_table::ShTable;

/// Texels along a side of a face: coarser shells cannot tell a window's light apart, finer ones cost more bytes
/// than a vertex is worth.
pub const RESOLUTIONS: RangeInclusive<usize> = 8..=64;

/// Texels of an `n` x `n` x 6 cubemap.
pub const fn n_texels(n: usize) -> usize {
    6 * n * n
}

/// Axes (a, s, t) of a face: its middle, along columns, along rows.
///
/// # Panics
/// When `face` is not in 0..6.
pub fn face_axes(face: usize) -> [Vec3; 3] {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    [[x, -z, -y], [-x, z, -y], [y, x, z], [-y, x, -z], [z, x, -y], [-z, -x, -y]][face]
}

/// A vector in the coordinates of a face with these axes: along columns, along rows, towards its middle.
pub(crate) fn flat([axis, s, t]: [Vec3; 3], v: Vec3) -> Vec3 {
    Vec3::new(v.dot(s), v.dot(t), v.dot(axis))
}

/// The texel that a direction of any length falls into; always below 6 n².
#[inline]
pub fn texel_of(n: usize, d: Vec3) -> usize {
    let (face, at) = on_face(n, d);
    // Saturating casts keep zero, NaN and the far edge inside.
    let cell = |x: f32| (x as usize).min(n - 1);
    (face * n + cell(at.y)) * n + cell(at.x)
}

/// The face that a direction of any length falls on, and where, in texels along columns and rows, 0 to n.
#[inline]
pub(crate) fn on_face(n: usize, d: Vec3) -> (usize, Vec2) {
    let size = d.abs();
    let (face, axis, x, y) = if size.x >= size.y && size.x >= size.z {
        if d.x >= 0.0 { (0, size.x, -d.z, -d.y) } else { (1, size.x, d.z, -d.y) }
    } else if size.y >= size.z {
        if d.y >= 0.0 { (2, size.y, d.x, d.z) } else { (3, size.y, d.x, -d.z) }
    } else if d.z >= 0.0 {
        (4, size.z, d.x, -d.y)
    } else {
        (5, size.z, -d.x, -d.y)
    };
    let scale = 0.5 * n as f32 / axis;
    (face, Vec2::new(x, y) * scale + 0.5 * n as f32)
}

/// Unit direction of a point of a texel; `within` is 0..=1 along columns and rows, (0.5, 0.5) the centre.
///
/// # Panics
/// When `texel` is not below 6 n².
pub fn direction(n: usize, texel: usize, within: Vec2) -> Vec3 {
    sample(n, texel, within).0
}

/// As [`direction`], and the solid angle that the whole texel would have if it were all like there: the mean over a
/// stratified set of `within` times a function's values is the function's integral over the texel.
///
/// # Panics
/// When `texel` is not below 6 n².
pub fn sample(n: usize, texel: usize, within: Vec2) -> (Vec3, f32) {
    let (face, [column, row]) = place(n, texel);
    let cell = 2.0 / n as f32;
    let p = (Vec2::new(column as f32, row as f32) + within) * cell - 1.0;
    let [axis, s, t] = face_axes(face);
    let square = 1.0 + p.length_squared();
    let length = square.sqrt();
    ((axis + p.x * s + p.y * t) / length, cell * cell / (square * length))
}

/// Exact solid angle of a texel, steradians; all texels together are 4π.
///
/// # Panics
/// When `n` is 0.
pub fn solid_angle(n: usize, texel: usize) -> f32 {
    let (_, [column, row]) = place(n, texel);
    let at = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
    box_solid_angle([at(column), at(row)], [at(column + 1), at(row + 1)]) as f32
}

/// Solid angle of a box on a face.
fn box_solid_angle([x0, y0]: [f64; 2], [x1, y1]: [f64; 2]) -> f64 {
    let a = |x: f64, y: f64| (x * y).atan2((1.0 + x * x + y * y).sqrt());
    (a(x1, y1) - a(x0, y1)) - (a(x1, y0) - a(x0, y0))
}

/// Face, and column and row on it.
pub(crate) fn place(n: usize, texel: usize) -> (usize, [usize; 2]) {
    let (face, at) = (texel / (n * n), texel % (n * n));
    (face, [at % n, at / n])
}

#[cfg(test)]
mod tests;
