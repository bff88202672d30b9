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

mod gate;
mod orient;
mod outside;

use std::sync::atomic::AtomicU64;

use glam::Vec3;
use lunette_relight::asset::{Asset, Shell};
use lunette_relight::cubemap::ShTable;
use lunette_scenes::{Portal, Scene};

use crate::carrier::{Lie, carrier};
use crate::energy::{self, BandEnergy};
use crate::fill::{self, Donors};
use crate::gather::{Arriving, Pass, bounced, buried};
use crate::photon::{self, Emission};
use crate::rows::{self, Aim, Opening, Row, Stage};
use crate::sampling::{HemisphereSets, hash};
use crate::smooth::{self, Smoother};
use crate::{Basis, Error, Options, Progress, Surface, mesh_asset};
pub use gate::Gates;
pub(crate) use orient::inwards;

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

/// Rays by which a vertex is judged buried.
const BURIAL_RAYS: usize = 64;

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
    options.check()?;
    check(portals)?;
    if scene.mesh.index.is_empty() {
        return Err(Error::EmptyScene);
    }
    crate::pool(options.threads)?.install(|| {
        let mut surface = Surface::new(scene)?;
        let portals = &inwards(portals, &surface);
        surface.keep_inside(portals);
        let gates = Gates::new(portals)?;
        let sets = HemisphereSets::new(BURIAL_RAYS, hash(options.seed, u64::MAX));
        let owners = outside::owners(&surface, &gates, portals, options.seed);
        let unlit = outside::unlit(&surface, &gates, &owners, &sets);
        let reach = smooth::reach(&surface, &sets, &unlit);
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
}

impl Work<'_> {
    fn run(&self) -> Result<(Asset<'static>, PortalReport), Error> {
        let mut asset = mesh_asset(self.scene);
        asset.metadata.seed = self.options.seed;
        asset.metadata.options = self.options.describe();
        let mut report = PortalReport::default();
        let mut uniform = vec![0.0; self.scene.mesh.position.len()];
        for (k, portal) in self.portals.iter().enumerate() {
            asset.metadata.shells.push(Shell {
                name: portal.name.clone(),
                centre: Some(portal.centre().to_array()),
                normal: Some(portal.normal.to_array()),
                area: Some(portal.area()),
                tint: (portal.transmission != Vec3::ONE).then(|| portal.transmission.to_array()),
            });
            let direct_sh = self.direct(k, &mut asset, &mut report, &mut uniform)?;
            if !self.has_sh() {
                continue;
            }
            let order = self.choose_order(k, &direct_sh, &mut report)?;
            let direct_sh = truncated(direct_sh, self.options.indirect_order, order);
            let rows = self.bounced(k, order, &direct_sh)?;
            if self.portal_options.energy_share.is_none() {
                report.lines.push(energy_line(&portal.name, &energy::bands(&rows, order)));
            }
            let n_vertices = self.scene.mesh.position.len();
            let name = format!("portal.{k}.indirect.sh");
            asset.insert_scaled(&name, &[n_vertices, order * order, 3], &interleaved(&rows, order * order));
        }
        self.insert_carrier(&mut asset, &uniform)?;
        Ok((asset, report))
    }

    /// The bands that hold the share of the energy asked for, by the first bounce at a few vertices: later bounces
    /// carry less of the high bands.
    fn choose_order(&self, k: usize, direct_sh: &[f32], report: &mut PortalReport) -> Result<usize, Error> {
        let most = self.options.indirect_order;
        let Some(share) = self.portal_options.energy_share else { return Ok(most) };
        let n_lit = self.unlit.iter().filter(|u| !**u).count();
        let every = n_lit.div_ceil(PROBED).max(1);
        let mut skip = vec![true; self.unlit.len()];
        (0..skip.len()).filter(|&v| !self.unlit[v]).step_by(every).for_each(|v| skip[v] = false);
        let rows = self.gather(k, most, 1, direct_sh, &skip)?;
        let bands = energy::bands(&rows, most);
        let order = energy::order_for(&bands, share);
        report.lines.push(energy_line(&self.portals[k].name, &bands));
        report.lines.push(format!(
            "portal {}: {order} bands hold {:.1} % of it",
            self.portals[k].name,
            100.0 * energy::cumulative(&bands)[order - 1]
        ));
        Ok(order)
    }

    /// Whether bounced light is baked as SH.
    fn has_sh(&self) -> bool {
        self.options.bounces > 0 && self.options.has(Basis::Sh)
    }

    /// Encodes the rows of portal `k`; gives their SH transfer, \[V, m²\], and adds the irradiance under a sky of
    /// radiance 1 to `uniform`.
    fn direct(
        &self,
        k: usize,
        asset: &mut Asset<'static>,
        report: &mut PortalReport,
        uniform: &mut [f32],
    ) -> Result<Vec<f32>, Error> {
        let n = self.options.resolution;
        let n_vertices = self.scene.mesh.position.len();
        let order = if self.has_sh() { self.options.indirect_order } else { 0 };
        let polygons = self.portals[k].convex_polygons();
        let aim = |opening| Aim {
            surface: self.surface,
            opening,
            n,
            rays: self.options.rays,
            seed: hash(self.options.seed, 0xd1 + k as u64),
        };
        let through = aim(Opening::Portal { gates: self.gates, polygons });
        let outside = aim(Opening::Sky(Some(self.gates)));
        let table = ShTable::new(n, order.max(1));
        let source = self.donors.sources(n_vertices);
        let mut direct_sh = vec![0.0; n_vertices * order * order];
        let stage = format!("portal {} of {}, direct", k + 1, self.portals.len());
        let stage = Stage { name: &stage, rays: self.options.rays, progress: self.progress };
        let compute = |v: usize, [row, open]: &mut [Row; 2]| {
            let mut sh = vec![0.0; order * order];
            if self.unlit[v] {
                return (sh, 0.0);
            }
            through.row(v, source[v], row);
            if self.owners[source[v]] == k as u32 {
                outside.row(v, source[v], open);
                row.add(open);
            }
            table.transfer(row.lit(), &mut sh);
            (sh, row.lit().map(|(_, value)| value).sum::<f32>())
        };
        let (store, worst) = rows::encode(n, n_vertices, &stage, compute, |v, (sh, sum)| {
            uniform[v] += sum;
            direct_sh[v * sh.len()..][..sh.len()].copy_from_slice(&sh);
        })?;
        report.lines.push(format!(
            "portal {}: {:.2} m², {} bytes of direct light per vertex ({} % of rows in Haar wavelets), at most {:.1} % of a row lost",
            self.portals[k].name,
            self.portals[k].area(),
            store.bytes() / n_vertices,
            100 * store.n_haar() / n_vertices,
            100.0 * worst
        ));
        let prefix = format!("portal.{k}.direct");
        store.insert_into(asset, &prefix, n).map_err(|e| Error::TooLarge(e.to_string()))?;
        Ok(direct_sh)
    }

    /// Bounced light of portal `k`, \[V, 3 m²\], red, green, blue.
    fn bounced(&self, k: usize, m: usize, direct_sh: &[f32]) -> Result<Vec<f32>, Error> {
        let mut rows = match self.portal_options.start {
            Start::Gathering => self.gather(k, m, self.options.bounces, direct_sh, &self.unlit)?,
            Start::Photons(count) => {
                let all = self.photons(k, m, count)?;
                let before_last = if self.options.bounces > 1 { &all[..] } else { &[] };
                self.pass(k, m, (1, 1), (&all, before_last), &self.unlit)?
            }
        };
        self.smoother.apply(&mut rows, 3 * m * m);
        Ok(rows)
    }

    /// As [`Work::bounced`], iterated from the direct light at the vertices.
    fn gather(
        &self,
        k: usize,
        m: usize,
        bounces: usize,
        direct_sh: &[f32],
        skip: &[bool],
    ) -> Result<Vec<f32>, Error> {
        let mut last: Vec<f32> =
            direct_sh.chunks_exact(m * m).flat_map(|row| [row, row, row].concat()).collect();
        let mut before_last = Vec::new();
        for b in 1..=bounces {
            let rows = self.pass(k, m, (b, bounces), (&last, &before_last), skip)?;
            if b == bounces {
                return Ok(rows);
            }
            let mut next = rows;
            for (row, direct) in next.chunks_exact_mut(3 * m * m).zip(direct_sh.chunks_exact(m * m)) {
                for plane in row.chunks_exact_mut(m * m) {
                    plane.iter_mut().zip(direct).for_each(|(a, d)| *a += d);
                }
            }
            before_last = std::mem::replace(&mut last, next);
        }
        Ok(vec![0.0; last.len()])
    }

    /// What surfaces throw back of the light that arrives at them, `(last, before_last)` as for [`Arriving`]; pass b of
    /// several.
    fn pass(
        &self,
        k: usize,
        m: usize,
        (b, n_passes): (usize, usize),
        (last, before_last): (&[f32], &[f32]),
        skip: &[bool],
    ) -> Result<Vec<f32>, Error> {
        // A path that goes on from an outer surface brings the sky's light straight.
        let corners = |t: u32| self.scene.mesh.index[t as usize];
        let is_outer = |t: u32| corners(t).iter().any(|&v| self.owners[v as usize] == k as u32);
        let escapes = |triangle, origin, d| match self.gates.first(origin, d) {
            Some(portal) => portal == k as u32,
            None => is_outer(triangle),
        };
        let n_vertices = self.scene.mesh.position.len();
        let rays = (self.options.rays / 4).max(128).next_multiple_of(16);
        let sets = HemisphereSets::new(rays, hash(self.options.seed, (b + 1000 * (k + 1)) as u64));
        let pass = Pass {
            surface: self.surface,
            sets: &sets,
            order: m,
            seed: hash(self.options.seed, b as u64),
            stage: &format!("portal {} of {}, bounce {b}", k + 1, self.portals.len()),
            total: (n_passes * n_vertices * rays) as u64,
            done: &AtomicU64::new(((b - 1) * n_vertices * rays) as u64),
        };
        let light = Arriving { last, before_last, many: None, escapes: &escapes, unlit: skip };
        let mut rows = vec![0.0; n_vertices * 3 * m * m];
        bounced(&pass, &light, &mut rows, self.progress)?;
        self.donors.fill(&mut rows, 3 * m * m);
        Ok(rows)
    }

    /// All light at the vertices but the last bounce, by photons.
    fn photons(&self, k: usize, m: usize, count: u64) -> Result<Vec<f32>, Error> {
        let m2 = m * m;
        let n_vertices = self.scene.mesh.position.len();
        let emission = Emission {
            surface: self.surface,
            gates: self.gates,
            portal: &self.portals[k],
            k: k as u32,
            order: m,
            hits: self.options.bounces,
            seed: self.options.seed,
        };
        let mut planes = [(); 3].map(|()| vec![0.0; n_vertices * m2]);
        photon::trace(&emission, 0, count, &self.scene.mesh.vertex_area(), &mut planes, self.progress)?;
        let per_photon = 1.0 / count as f32;
        let mut rows = Vec::with_capacity(3 * n_vertices * m2);
        for v in 0..n_vertices {
            for plane in &planes {
                rows.extend(plane[v * m2..][..m2].iter().map(|x| x * per_photon));
            }
        }
        self.donors.fill(&mut rows, 3 * m2);
        Ok(rows)
    }

    fn insert_carrier(&self, asset: &mut Asset<'static>, uniform: &[f32]) -> Result<(), Error> {
        if self.options.bounces == 0 || !self.options.has(Basis::DirectToIndirect) {
            return Ok(());
        }
        let lie = Lie { buried: &self.buried, unlit: &self.unlit, uniform, smoother: &self.smoother };
        carrier(self.scene, self.surface, self.options, &lie, self.progress)?.insert_into(asset);
        Ok(())
    }
}

/// Vertices at which energy is probed.
const PROBED: usize = 2048;

/// Rows of n² values cut to m².
fn truncated(rows: Vec<f32>, n: usize, m: usize) -> Vec<f32> {
    if n == m { rows } else { rows.chunks_exact(n * n).flat_map(|r| r[..m * m].iter().copied()).collect() }
}

/// Rows of three planes of `n` values, value by value.
fn interleaved(rows: &[f32], n: usize) -> Vec<f32> {
    rows.chunks_exact(3 * n).flat_map(|r| (0..n).flat_map(move |i| [r[i], r[n + i], r[2 * n + i]])).collect()
}

fn energy_line(name: &str, bands: &[BandEnergy]) -> String {
    let shares: Vec<String> = energy::cumulative(bands).iter().map(|s| format!("{:.1}", 100.0 * s)).collect();
    format!(
        "portal {name}: % of the energy of bounced light in the first 1, 2, ... SH bands: {}",
        shares.join(" ")
    )
}
