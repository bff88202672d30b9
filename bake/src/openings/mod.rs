//! Finding an interior's portals: the panes and the plain holes that part its inside from its outside.
//!
//! Where the inside is, and which surface of least area parts it from the outside, is found on a grid (`grid`,
//! `cut`). A see-through surface with the inside on one side and the outside on the other is a portal, so that a
//! window is one and a drinking glass is not; where that surface passes through thin air, the hole's outline is
//! measured with rays (`outline`).
//!
//! Based on: Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009, whose
//! portals have to be given.
//!
//! Where it breaks: see the parts. An opening narrower than a cell may be missed, and one of a cell or two comes out
//! ragged or tilted: more cells help. Where a wall and its corner are missing, as at the open end of a corridor, flat
//! polygons overlap and leave gaps. What is inside and what outside is a matter of opinion for arcades, porches and
//! courtyards; the nook under a ball counts as inside. [`leak_share`] tells how much light enters beside what was found.
//! A hole within the room, as of a chimney, lies before the windows seen through it, and of a sun through both neither is
//! sharp.
//! Portals are proposals, to be looked at.

mod bars;
mod cluster;
mod cut;
mod grid;
mod inside;
mod outline;
mod panes;
mod parted;
mod raster;
mod rays;
mod sides;
#[cfg(test)]
mod tests;

use glam::Vec3;
use lunette_scenes::{Portal, Scene};
use rayon::prelude::*;

pub use inside::inside;
pub use parted::parted;
pub use sides::{leak_share, orient};

use crate::{Error, Progress};
use cut::CutLink;
use grid::Grid;
use outline::Space;
use rays::Rays;

/// Name of the portal of plain holes, unless there is glass of that name.
pub const OPENING: &str = "opening";

/// Which holes share a portal, and with it a shell of outside light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// All of one material, and all plain holes: right where everything outside is far away.
    #[default]
    Joined,
    /// Every window is its own, numbered from 1.
    Apart,
}

/// How to look for openings.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Cells of the grid around the interior, 1,000..=20,000,000; none makes them 0.15 m wide, but no fewer than 300,000
    /// and no more than 1,000,000. Time and memory (150 bytes each) grow with it; an opening narrower than a cell may
    /// be missed.
    pub cells: Option<usize>,
    /// Holes of less area, m², are left out: cracks between walls.
    pub smallest_area: f32,
    /// Holes with no more than this between them, metres, are panes of one window, which a bake parts again ([`parted`]), more
    /// exactly than they are found here; 0 leaves every hole alone.
    pub widest_bar: f32,
    /// What shares a portal.
    pub grouping: Grouping,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads, 0 for all cores.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            cells: None,
            smallest_area: 0.01,
            widest_bar: 0.2,
            grouping: Grouping::Joined,
            seed: 1,
            threads: 0,
        }
    }
}

impl Options {
    /// # Errors
    /// [`Error::Option`] for the first that is out of range.
    pub fn check(&self) -> Result<(), Error> {
        if let Some(cells) = self.cells.filter(|n| !(1_000..=20_000_000).contains(n)) {
            let what = format!("{cells} is not in 1000..=20000000");
            return Err(Error::Option { name: "cells", what });
        }
        for (name, value) in [("smallest-area", self.smallest_area), ("widest-bar", self.widest_bar)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Option { name, what: format!("{value} is not a size from 0 up") });
            }
        }
        Ok(())
    }
}

/// Proposes the portals of a scene, panes first, in the order of the scene's materials, then plain holes, largest
/// first; wound so that their normals point inside.
///
/// # Errors
/// [`Error::NoInterior`] where nothing is inside, [`Error::NoOpening`] where nothing leads out. When an option is out of range, the scene has nothing that blocks light, Embree cannot be had, or `progress` asks
/// to stop.
pub fn find(scene: &Scene, options: &Options, progress: &dyn Progress) -> Result<Vec<Portal>, Error> {
    options.check()?;
    crate::pool(options.threads)?.install(|| {
        let rays = Rays::new(scene)?;
        let grid = Grid::new(scene, &rays, options, progress)?.ok_or(Error::NoInterior)?;
        let sides = cut::sides(&grid, options.seed)?;
        let links = cut::cut_links(&grid, &sides);
        let space = Space { rays: &rays, grid: &grid, sides: &sides };
        let mut found = panes::find(scene, &space, &links);
        let name = if found.iter().any(|p| p.name == OPENING) { "plain opening" } else { OPENING };
        found.extend(holes(&space, &links, name, options));
        if found.is_empty() {
            return Err(Error::NoOpening);
        }
        Ok(grouped(found, options.grouping))
    })
}

/// Plain holes, each a portal, the largest first.
fn holes(space: &Space, links: &[CutLink], name: &str, options: &Options) -> Vec<Portal> {
    let clusters = cluster::clusters(space.grid, links);
    let polygons: Vec<Vec<Vec3>> =
        clusters.par_iter().flat_map_iter(|links| outline::polygons(space, links)).collect();
    let polygons = bars::joined(polygons, options.widest_bar, space.rays);
    let portal = |p: &Vec<Vec3>| Portal::from_polygons(name, std::slice::from_ref(p), Vec3::ONE);
    let mut holes: Vec<Portal> =
        polygons.iter().filter_map(portal).filter(|p| p.area() >= options.smallest_area).collect();
    holes.sort_by(|a, b| b.area().total_cmp(&a.area()));
    holes
}

/// Portals by name, each name once, as portal files have it: numbers at the end of all of them keep names apart.
fn grouped(found: Vec<Portal>, grouping: Grouping) -> Vec<Portal> {
    let mut names: Vec<&str> = Vec::new();
    found.iter().for_each(|p| {
        if !names.contains(&p.name.as_str()) {
            names.push(&p.name);
        }
    });
    let of = |name: &str| found.iter().filter(|p| p.name == name).cloned().collect::<Vec<_>>();
    let group = |name: &&str| match grouping {
        Grouping::Joined => {
            let all = of(name);
            let triangles = all.iter().flat_map(|p| p.triangles.clone()).collect();
            Portal::new(name, triangles, all[0].transmission).into_iter().collect()
        }
        Grouping::Apart => {
            let numbered = |(i, p): (usize, Portal)| Portal { name: format!("{name} {}", i + 1), ..p };
            of(name).into_iter().enumerate().map(numbered).collect::<Vec<_>>()
        }
    };
    names.iter().flat_map(group).collect()
}
