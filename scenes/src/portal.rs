//! Portals: the openings through which outside light enters an interior.
//!
//! A portal is a set of triangles that block nothing. It comes from the scene's own glass ([`take_portals`]), from a
//! sidecar file ([`read_portals`]), or is found by tracing rays, elsewhere. All windows that share one portal share
//! one shell of outside radiance, centred on the portal, which holds as long as nothing outside is near: see
//! [`split_portals`].
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi & Nishita, Interactive Rendering of Interior Scenes with Dynamic Environment
//! Illumination, 2009.
//!
//! Where it breaks: a pane modelled as a thin box is two sheets, one behind the other; both are portals, and though light
//! enters once, their area counts twice.

mod doubled;
mod merge;
mod sidecar;
mod split;
mod take;
#[cfg(test)]
mod tests;
mod unglaze;

use glam::{DVec3, Vec3};

pub use doubled::without_doubled;
pub use sidecar::{SIDECAR_FORMAT, SIDECAR_VERSION, read_portals, sidecar_path, write_portals};
pub use split::{MOST_THROWN_BACK, Split, split_portals, thrown_back};
pub use take::take_portals;
pub use unglaze::unglaze;

use crate::{polygon, repair};

/// Where portals' windows look in so different directions that less than this share of their area is left in the sum
/// of their area vectors, no mean direction is worth the name.
const OPPOSED: f64 = 1e-3;

/// Triangles through which outside light enters.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// Unique among the portals of a scene; mostly that of the material.
    pub name: String,
    /// Corners, metres, counter-clockwise seen from the interior. None is without area.
    pub triangles: Vec<[Vec3; 3]>,
    /// Unit, into the interior: the mean over the area; that of the largest triangle where windows face each other
    /// and the mean vanishes.
    pub normal: Vec3,
    /// Share of light let through, 0..=1 in each channel.
    pub transmission: Vec3,
}

impl Portal {
    /// A portal of these triangles, those without area left out; `None` if none is left.
    pub fn new(name: &str, mut triangles: Vec<[Vec3; 3]>, transmission: Vec3) -> Option<Portal> {
        triangles.retain(|t| t.iter().all(|p| p.is_finite()) && !repair::is_flat(*t));
        let normal = mean_normal(&triangles)?;
        Some(Portal { name: name.to_owned(), triangles, normal, transmission })
    }

    /// A portal of flat polygons, counter-clockwise seen from the interior; `None` if none has an area.
    pub fn from_polygons(name: &str, polygons: &[Vec<Vec3>], transmission: Vec3) -> Option<Portal> {
        let mut triangles = Vec::new();
        let mut cut = Vec::new();
        for corners in polygons {
            polygon::triangulate(corners, &mut cut);
            triangles.extend(cut.iter().map(|t| t.map(|i| corners[i])));
        }
        Portal::new(name, triangles, transmission)
    }

    /// Its windows, the parts that hang together by corners, each as a portal of the same name.
    pub fn windows(&self) -> Vec<Portal> {
        let window = |triangles| Portal::new(&self.name, triangles, self.transmission);
        split::windows(&self.triangles).into_iter().filter_map(window).collect()
    }

    /// The mean of all its points, metres.
    pub fn centre(&self) -> Vec3 {
        let moment = |t: &[Vec3; 3]| {
            let [a, b, c] = t.map(|p| p.as_dvec3());
            (a + b + c) / 3.0 * area(t)
        };
        let total: f64 = self.triangles.iter().map(area).sum();
        (self.triangles.iter().map(moment).sum::<DVec3>() / total).as_vec3()
    }

    /// Of all its triangles, m².
    pub fn area(&self) -> f32 {
        self.triangles.iter().map(area).sum::<f64>() as f32
    }

    /// The largest distance between two of its points, metres.
    pub fn extent(&self) -> f32 {
        split::extent(&self.triangles)
    }

    /// Turns the side that was taken for the interior outwards.
    pub fn flip(&mut self) {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self.normal = -self.normal;
    }

    /// The portal as few flat polygons, wound as its triangles are: connected triangles of one plane are one polygon,
    /// or several convex ones around a hole, and so are neighbours along a whole edge that are convex together.
    pub fn polygons(&self) -> Vec<Vec<Vec3>> {
        merge::polygons(&self.triangles)
    }

    /// As [`Portal::polygons`], those that are not convex cut into some that are.
    pub fn convex_polygons(&self) -> Vec<Vec<Vec3>> {
        let parts = |p: &Vec<Vec3>| {
            polygon::convex_parts(p)
                .into_iter()
                .map(|part| part.iter().map(|&i| p[i]).collect())
                .collect::<Vec<_>>()
        };
        self.polygons().iter().flat_map(parts).collect()
    }

    /// The edges of its polygons, for drawing.
    pub fn outline(&self) -> Vec<[Vec3; 2]> {
        let polygons = self.polygons();
        polygons.iter().flat_map(|p| (0..p.len()).map(|i| [p[i], p[(i + 1) % p.len()]])).collect()
    }
}

fn area(t: &[Vec3; 3]) -> f64 {
    repair::cross(*t).length() / 2.0
}

fn mean_normal(triangles: &[[Vec3; 3]]) -> Option<Vec3> {
    let crosses = || triangles.iter().map(|t| repair::cross(*t));
    let total: f64 = crosses().map(|c| c.length()).sum();
    let sum: DVec3 = crosses().sum();
    let largest = crosses().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let normal = if sum.length() > OPPOSED * total { sum } else { largest };
    Some(normal.normalize().as_vec3())
}
