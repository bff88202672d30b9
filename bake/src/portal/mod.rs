//! Portal shells: direct transfer through each opening on a cubemap, bounced light as SH or direct-to-indirect.
//!
//! Portal by portal, so that memory grows with vertices and not with vertices times texels times portals: the rows
//! of a block of vertices are computed dense, encoded, and appended in order.
//!
//! Bounced SH light can start from two places. *Photons* leave the portal and are gathered once at the end, as in the
//! paper. *Gathering* starts from the direct light at the vertices, which is known exactly from the rows, and
//! iterates. Both are kept; the second has less noise for the same time and is the default.
//!
//! Based on: Y. Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009.

mod bounced;
mod gate;
mod outside;
mod resume;
mod reveal;

use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::Vec3;
use lunette_relight::asset::{Asset, Data, Shell};
use lunette_relight::cubemap::n_texels;
use lunette_relight::portal_frame::{Pane, Reveal};
use lunette_relight::sparse::{Rows, SparseLight};
use lunette_scenes::{Portal, Scene, without_doubled};
use rayon::prelude::*;

use crate::buried::{self, buried};
use crate::carrier::{Lie, carrier};
use crate::fill::{self, Donors};
use crate::glossy;
use crate::rows::{self, Aim, Lies, Opening, Row, Stage};
use crate::sampling::hash;
use crate::smooth::{self, Smoother};
use crate::{Basis, Error, Options, Progress, Surface, mesh_asset, openings};
pub use gate::Gates;
use outside::{Outside, outside};
use reveal::{STEPS, reveals};

/// Where bounced SH light starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The direct light at the vertices.
    Gathering,
    /// Photons, this many per portal, and one final gathering.
    Photons(u64),
}

/// What portals need beyond [`Options`].
#[derive(Clone, Copy, Debug)]
pub struct PortalOptions {
    /// Bounced SH light.
    pub start: Start,
    /// Share of the light's greatest possible energy at which `--order auto` stops, 0..=1; none keeps
    /// [`Options::indirect_order`].
    pub energy_share: Option<f64>,
}

impl Default for PortalOptions {
    fn default() -> Self {
        PortalOptions { start: Start::Gathering, energy_share: None }
    }
}

/// What a portal bake found out, for the user.
#[derive(Clone, Debug, Default)]
pub struct PortalReport {
    /// Per portal: bytes of direct rows, the share lost to quantisation, the energy of the SH bands.
    pub lines: Vec<String>,
}

/// Bakes a scene that is lit through portals; `scene` is without the portals' triangles.
///
/// # Errors
/// As [`crate::bake`], and when there is no portal.
pub fn bake_portals(
    scene: &Scene,
    portals: &[Portal],
    options: &Options,
    portal_options: &PortalOptions,
    progress: &dyn Progress,
) -> Result<(Asset<'static>, PortalReport), Error> {
    bake(scene, portals, (options, portal_options), None, progress)
}

/// As [`bake_portals`], from where an earlier bake of the same scene, rays, bounces, resolution and seed has come to:
/// direct rows, bounced bands and direct-to-indirect transport that are there stay, more bands are added to those, and
/// more photons are averaged with those that were traced.
///
/// # Errors
/// As [`bake_portals`], and when the earlier bake is of another scene or other options.
pub fn continue_portals(
    earlier: &Asset,
    scene: &Scene,
    portals: &[Portal],
    options: &Options,
    portal_options: &PortalOptions,
    progress: &dyn Progress,
) -> Result<(Asset<'static>, PortalReport), Error> {
    bake(scene, portals, (options, portal_options), Some(earlier), progress)
}

fn bake(
    scene: &Scene,
    portals: &[Portal],
    (options, portal_options): (&Options, &PortalOptions),
    earlier: Option<&Asset>,
    progress: &dyn Progress,
) -> Result<(Asset<'static>, PortalReport), Error> {
    options.check()?;
    check(portals)?;
    if scene.mesh.index.is_empty() {
        return Err(Error::EmptyScene);
    }
    crate::pool(options.threads)?.install(|| {
        let mut surface = Surface::new(scene)?;
        let (portals, n_doubled) = without_doubled(portals).map_err(Error::Scene)?;
        if n_doubled > 0 {
            progress.note(&format!("portals: {n_doubled} triangles in the place of others left out"));
        }
        let (portals, n_parted) = openings::parted(scene, &portals, progress)?;
        if n_parted > 0 {
            let n_panes: usize = portals.iter().map(|p| p.polygons().len()).sum();
            let s = if n_parted == 1 { "" } else { "s" };
            progress.note(&format!("portals: bars part {n_parted} window{s}; {n_panes} panes in all"));
        }
        let portals = &portals[..];
        surface.keep_inside(portals);
        let gates = Gates::new(portals)?;
        let sets = buried::sets(options.seed);
        let rho = grey_reflectance(scene);
        let Outside { owners, unlit } = outside(&surface, &gates, portals, &sets, &rho, options.seed);
        let reach = smooth::reach(&surface, Some(&gates), &sets, &unlit);
        let smoother = Smoother::new(&scene.mesh, &reach);
        let lit: Vec<usize> = (0..scene.mesh.position.len()).filter(|&v| !unlit[v]).collect();
        let buried = buried(&surface, &sets, &lit);
        let donors = fill::donors(&scene.mesh, &buried);
        let work = Work {
            scene,
            surface: &surface,
            gates: &gates,
            portals,
            options,
            portal_options,
            progress,
            donors,
            buried,
            owners,
            unlit,
            smoother,
            earlier,
        };
        work.run()
    })
}

fn check(portals: &[Portal]) -> Result<(), Error> {
    if portals.is_empty() {
        return Err(Error::Option {
            name: "portal",
            what: "there is no portal; name one or let `lunette portals` find some".into(),
        });
    }
    Ok(())
}

struct Work<'a> {
    scene: &'a Scene,
    surface: &'a Surface<'a>,
    gates: &'a Gates,
    portals: &'a [Portal],
    options: &'a Options,
    portal_options: &'a PortalOptions,
    progress: &'a dyn Progress,
    donors: Donors,
    /// Vertices inside other geometry, ascending.
    buried: Vec<usize>,
    /// Portals of the outer vertices that are seen from one.
    owners: Vec<u32>,
    /// Vertices outside that are seen from none.
    unlit: Vec<bool>,
    smoother: Smoother,
    /// What there is already.
    earlier: Option<&'a Asset<'a>>,
}

impl Work<'_> {
    fn run(&self) -> Result<(Asset<'static>, PortalReport), Error> {
        let mut asset = mesh_asset(self.scene);
        asset.metadata.seed = self.options.seed;
        asset.metadata.options = self.options.describe();
        if let Start::Photons(count) = self.portal_options.start {
            let count = count.max(self.earlier.map_or(0, resume::photons));
            asset.metadata.options.insert("photons".into(), count.into());
        }
        asset.metadata.shells.extend(self.portals.iter().map(shell));
        if let Some(earlier) = self.earlier {
            resume::check(earlier, &asset)?;
        }
        let mut report = PortalReport::default();
        for k in 0..self.portals.len() {
            self.insert_direct(k, &mut asset, &mut report)?;
            if self.options.bounces > 0 && self.options.has(Basis::Sh) {
                self.insert_bounced(k, &mut asset, &mut report)?;
            }
        }
        self.insert_carrier(&mut asset)?;
        self.insert_glossy(&mut asset, &mut report)?;
        Ok((asset, report))
    }

    /// Encodes the rows of portal `k`.
    fn insert_direct(
        &self,
        k: usize,
        asset: &mut Asset<'static>,
        report: &mut PortalReport,
    ) -> Result<(), Error> {
        let prefix = format!("portal.{k}.direct");
        let polygons = self.portals[k].convex_polygons();
        let seed = hash(self.options.seed, 0xe1 + k as u64);
        let reveals = reveals(self.surface, &polygons, seed);
        self.insert_panes(k, (&polygons, &reveals), asset);
        if let Some(earlier) = self.earlier {
            resume::copy(earlier, &prefix, asset);
            return Ok(());
        }
        let n = self.options.resolution;
        let n_vertices = self.scene.mesh.position.len();
        let aim = |opening| Aim {
            surface: self.surface,
            opening,
            n,
            rays: self.options.rays,
            seed: hash(self.options.seed, 0xd1 + k as u64),
        };
        let panes =
            polygons.iter().zip(&reveals).map(|(polygon, reveals)| Pane::new(polygon, reveals)).collect();
        let through = aim(Opening::Portal { gates: self.gates, panes });
        let outside = aim(Opening::Sky(Some(self.gates)));
        let source = self.donors.sources(n_vertices);
        let stage = format!("portal {} of {}, direct", k + 1, self.portals.len());
        let stage = Stage { name: &stage, rays: self.options.rays, progress: self.progress };
        let is_seen = AtomicBool::new(false);
        let compute = |v: usize, [row, open]: &mut [Row; 2]| {
            if self.unlit[v] {
                return Lies::Outside;
            }
            through.row(v, source[v], row);
            is_seen.fetch_or(row.is_lit(), Ordering::Relaxed);
            if self.owners[source[v]] != k as u32 {
                return Lies::Inside;
            }
            outside.row(v, source[v], open);
            row.add(open);
            Lies::Outside
        };
        let (store, worst) = rows::encode(n, n_vertices, &stage, compute)?;
        if !is_seen.into_inner() {
            return Err(Error::UnseenPortal(self.portals[k].name.clone()));
        }
        report.lines.push(format!(
            "portal {}: {:.2} m², {} bytes of direct light per vertex ({} % of rows in Haar wavelets), at most {:.1} % of a row inside lost",
            self.portals[k].name,
            self.portals[k].area(),
            store.bytes() / n_vertices,
            100 * store.n_haar() / n_vertices,
            100.0 * worst
        ));
        store.insert_into(asset, &prefix, n).map_err(|e| Error::TooLarge(e.to_string()))
    }

    /// Where portal `k` is, and which vertices see the sky past it.
    fn insert_panes(
        &self,
        k: usize,
        (polygons, reveals): (&[Vec<Vec3>], &[Vec<Reveal>]),
        asset: &mut Asset<'static>,
    ) {
        let mut start = vec![0];
        start.extend(polygons.iter().scan(0, |end, polygon| {
            *end += polygon.len() as u32;
            Some(*end)
        }));
        let corners: Vec<f32> = polygons.iter().flatten().flat_map(|c| c.to_array()).collect();
        let n_vertices = self.scene.mesh.position.len();
        let source = self.donors.sources(n_vertices);
        let is_open = |&v: &usize| !self.unlit[v] && self.owners[source[v]] == k as u32;
        let open: Vec<u32> = (0..n_vertices).filter(is_open).map(|v| v as u32).collect();
        let mut insert =
            |part: &str, shape: &[usize], data| asset.insert(&format!("portal.{k}.{part}"), shape, data);
        insert("corner", &[corners.len() / 3, 3], Data::F32(Cow::Owned(corners)));
        let reveals: Vec<f32> = reveals.iter().flatten().flatten().copied().collect();
        insert("reveal", &[reveals.len() / (4 * STEPS), STEPS, 4], Data::F32(Cow::Owned(reveals)));
        insert("polygon", &[start.len()], Data::U32(Cow::Owned(start)));
        insert("open", &[open.len()], Data::U32(Cow::Owned(open)));
    }

    /// What the rows of portal `k` make of a light on its shell, three colours at a time.
    fn response(&self, k: usize, asset: &Asset, light: impl Fn(usize) -> [f32; 3]) -> Vec<[f32; 3]> {
        let mut out = vec![[0.0; 3]; self.scene.mesh.position.len()];
        // The rows were just put there, or were checked when their file was read.
        if let Ok(Some(rows)) = Rows::open(asset, &format!("portal.{k}.direct")) {
            let mut sparse = SparseLight::new(rows.n());
            sparse.set(&(0..n_texels(rows.n())).map(light).collect::<Vec<_>>());
            out.par_chunks_mut(VERTICES)
                .enumerate()
                .for_each(|(i, out)| rows.add(i * VERTICES, &sparse, out));
        }
        out
    }

    fn insert_glossy(&self, asset: &mut Asset<'static>, report: &mut PortalReport) -> Result<(), Error> {
        let source = self.donors.sources(self.scene.mesh.position.len());
        let options = glossy::GlossyOptions {
            patches: glossy::PATCHES,
            rays: self.options.rays,
            bounces: self.options.bounces,
            seed: self.options.seed,
        };
        let line = glossy::insert(asset, self.scene, self.surface, &source, &options, self.progress)?;
        report.lines.extend(line);
        Ok(())
    }

    fn insert_carrier(&self, asset: &mut Asset<'static>) -> Result<(), Error> {
        if self.options.bounces == 0 || !self.options.has(Basis::DirectToIndirect) {
            return Ok(());
        }
        if let Some(earlier) = self.earlier
            && resume::has_carrier(earlier, self.options)
        {
            resume::copy(earlier, "indirect", asset);
            return Ok(());
        }
        let mut uniform = vec![0.0; self.scene.mesh.position.len()];
        for k in 0..self.portals.len() {
            let lit = self.response(k, asset, |_| [1.0; 3]);
            uniform.iter_mut().zip(lit).for_each(|(sum, e)| *sum += e[0]);
        }
        let outer: Vec<bool> = self.owners.iter().map(|owner| *owner != outside::NONE).collect();
        let lie = Lie {
            buried: &self.buried,
            unlit: &self.unlit,
            outer: &outer,
            uniform: &uniform,
            smoother: &self.smoother,
        };
        carrier(self.scene, self.surface, self.options, &lie, self.progress)?.insert_into(asset);
        Ok(())
    }
}

/// Of each vertex.
fn grey_reflectance(scene: &Scene) -> Vec<f32> {
    glossy::vertex_reflectance(scene).into_iter().map(|rho| rho.element_sum() / 3.0).collect()
}

/// Vertices of one task.
const VERTICES: usize = 4096;

/// What the file says of a portal.
fn shell(portal: &Portal) -> Shell {
    Shell {
        name: portal.name.clone(),
        centre: Some(portal.centre().to_array()),
        normal: Some(portal.normal.to_array()),
        area: Some(portal.area()),
        tint: (portal.transmission != Vec3::ONE).then(|| portal.transmission.to_array()),
    }
}
