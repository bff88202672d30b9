//! Sphere sets: a mesh as a few dozen balls, to cast shadows when it moves.
//!
//! The error is the volume that the union of the balls and the body do not share, the outside volume of Wang et al.
//! plus the volume that is missed, both over the body's volume. It falls in three steps, all on a grid of
//! cells that are inside or outside the mesh:
//!
//! 1. medial balls, the largest that fit around a cell, are taken greedily, each the one that fills most of what
//!    is still empty (lazy greedy: gains only fall);
//! 2. centres and radii move in ever smaller steps for as long as the error falls, so that balls bulge a little
//!    and close the gaps between them;
//! 3. the ball that gives least is put where most is missing, if that gains, and step 2 repeats.
//!
//! The fit is judged on another, finer grid, and at points on the mesh.
//!
//! Based on: Wang, Zhou, Snyder, Liu, Bao, Peng and Guo, Variational sphere set approximation for solid objects,
//! 2006 (the error, descent and relocation); Bradshaw and O'Sullivan, Sphere-tree construction using dynamic medial
//! axis approximation, 2002 (medial balls).
//!
//! Where it breaks: parts thinner than a cell, the longest edge over [`SphereOptions::resolution`], are lost. A
//! mesh with holes is closed as most of six axis-parallel rays see it.

mod fit;
mod grid;
#[cfg(test)]
mod tests;

use glam::Vec3;
use lunette_relight::lobe::{Sphere, SphereSet};

use grid::Grid;

/// How many spheres, and how closely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereOptions {
    /// Spheres, 1..=4096; fewer come back where fewer fill the body. 64 do for a rabbit.
    pub n_spheres: usize,
    /// Cells along the longest edge of the bounding box, 16..=256. Time and memory grow with its cube.
    pub resolution: usize,
}

impl Default for SphereOptions {
    fn default() -> Self {
        SphereOptions { n_spheres: 64, resolution: 72 }
    }
}

/// A fitted set, and how far it is from the mesh.
#[derive(Clone, Debug)]
pub struct SphereFit {
    /// The spheres, in the mesh's own coordinates.
    pub set: SphereSet,
    /// Volume of the mesh \[m³\].
    pub volume: f32,
    /// Volume of the spheres outside the mesh, over the mesh's volume.
    pub outside: f32,
    /// Volume of the mesh outside the spheres, over the mesh's volume.
    pub missing: f32,
    /// Mean distance of the mesh's surface from that of the spheres, over the diagonal of the bounding box.
    pub surface: f32,
}

/// Why spheres cannot be fitted. `Display` is one line.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SphereError {
    /// There is no triangle.
    NoTriangle,
    /// A vertex is infinite or not a number.
    NotFinite(usize),
    /// A triangle names a vertex that is not there.
    Index(usize),
    /// The surface encloses nothing.
    NoVolume,
    /// An option is out of range.
    Option(&'static str),
}

impl std::fmt::Display for SphereError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SphereError::NoTriangle => write!(f, "the blocker's mesh has no triangle; give one that has"),
            SphereError::NotFinite(v) => {
                write!(f, "vertex {v} of the blocker's mesh is not finite; mend the mesh")
            }
            SphereError::Index(t) => {
                write!(f, "triangle {t} of the blocker's mesh has a vertex out of range; mend the mesh")
            }
            SphereError::NoVolume => {
                write!(f, "the blocker's mesh encloses no volume to fill with spheres; give a closed mesh")
            }
            SphereError::Option(what) => write!(f, "{what}"),
        }
    }
}

impl std::error::Error for SphereError {}

/// Fits spheres to the inside of a mesh. Takes about a second for 64 spheres at the default resolution; the same
/// mesh and options give the same spheres.
///
/// # Errors
/// When the mesh is broken or has no inside, or an option is out of range.
pub fn fit_spheres(
    position: &[Vec3],
    index: &[[u32; 3]],
    options: &SphereOptions,
) -> Result<SphereFit, SphereError> {
    check(position, index, options)?;
    let grid =
        Grid::new(position, index, options.resolution, Vec3::splat(0.5)).ok_or(SphereError::NoVolume)?;
    let balls = fit::fit(&grid, options.n_spheres);
    let spheres: Vec<Sphere> = balls.iter().map(|ball| grid.to_world(ball)).collect();
    // Finer and shifted, so that the fit is not judged by the cells that it was made with.
    let judge = Grid::new(position, index, options.resolution * 4 / 3, Vec3::new(0.21, 0.63, 0.37));
    let judge = judge.ok_or(SphereError::NoVolume)?;
    let (outside, missing) = fit::error(&judge, &spheres);
    let surface = surface_distance(position, index, &spheres);
    let set = SphereSet::new(spheres).map_err(|_| SphereError::NoVolume)?;
    Ok(SphereFit { set, volume: judge.volume(), outside, missing, surface })
}

fn check(position: &[Vec3], index: &[[u32; 3]], options: &SphereOptions) -> Result<(), SphereError> {
    if !(1..=4096).contains(&options.n_spheres) {
        return Err(SphereError::Option("the number of spheres must be in 1..=4096"));
    }
    if !(16..=256).contains(&options.resolution) {
        return Err(SphereError::Option("the resolution of a sphere set must be in 16..=256"));
    }
    if index.is_empty() {
        return Err(SphereError::NoTriangle);
    }
    if let Some(v) = position.iter().position(|p| !p.is_finite()) {
        return Err(SphereError::NotFinite(v));
    }
    let broken = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= position.len());
    index.iter().position(broken).map_or(Ok(()), |t| Err(SphereError::Index(t)))
}

/// Mean distance from the centroids of the triangles to the union's surface, weighted by area, over the diagonal.
fn surface_distance(position: &[Vec3], index: &[[u32; 3]], spheres: &[Sphere]) -> f32 {
    let (mut sum, mut weight) = (0.0f64, 0.0f64);
    for t in index {
        let [a, b, c] = t.map(|v| position[v as usize]);
        let centroid = (a + b + c) / 3.0;
        let area = f64::from((b - a).cross(c - a).length());
        let distance = |s: &Sphere| s.centre.distance(centroid) - s.radius;
        let nearest = spheres.iter().map(distance).fold(f32::INFINITY, f32::min);
        sum += area * f64::from(nearest.abs());
        weight += area;
    }
    let (low, high) = grid::bounds(position, index);
    (sum / weight.max(1e-30)) as f32 / low.distance(high).max(1e-30)
}
