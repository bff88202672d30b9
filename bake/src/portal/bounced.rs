//! Bounced light of one portal as SH, column by column: any range of coefficients by itself, so that more bands continue
//! what is there.

use std::ops::Range;
use std::sync::atomic::AtomicU64;

use lunette_relight::asset::Asset;
use lunette_relight::cubemap::ShTable;

use super::{PortalReport, Start, Work, resume};
use crate::Error;
use crate::energy::{self, BandEnergy};
use crate::gather::{Arriving, Pass, bounced};
use crate::photon::{self, Emission};
use crate::sampling::{HemisphereSets, hash};

/// Vertices at which energy is probed.
const PROBED: usize = 2048;

/// SH coefficients.
type Columns = Range<usize>;

impl Work<'_> {
    /// Chooses the order, measures the bands, and stores the rows of portal `k`.
    pub(super) fn insert_bounced(
        &self,
        k: usize,
        asset: &mut Asset<'static>,
        report: &mut PortalReport,
    ) -> Result<(), Error> {
        let order = self.choose_order(k, asset, report)?;
        let rows = self.rows(k, order * order, asset)?;
        if self.portal_options.energy_share.is_none() {
            report.lines.push(energy_line(&self.portals[k].name, &energy::bands(&rows, order)));
        }
        let n = order * order;
        let by_value = |r: &[f32]| (0..n).flat_map(|i| [r[i], r[n + i], r[2 * n + i]]).collect::<Vec<_>>();
        let values: Vec<f32> = rows.chunks_exact(3 * n).flat_map(by_value).collect();
        asset.insert_scaled(&format!("portal.{k}.indirect.sh"), &[values.len() / (3 * n), n, 3], &values);
        Ok(())
    }

    /// Rows of coefficients 0..n, \[V, 3 n\], red, green, blue; those of an earlier bake stay, or are averaged with new
    /// photons.
    fn rows(&self, k: usize, n: usize, asset: &Asset) -> Result<Vec<f32>, Error> {
        let all = match self.portal_options.start {
            Start::Gathering => 0,
            Start::Photons(count) => count.max(self.earlier.map_or(0, resume::photons)),
        };
        let Some(there) = self.earlier.and_then(|e| resume::bounced(e, k, n)) else {
            return self.bounced(k, 0..n, 0..all, asset);
        };
        let mut low = there.rows;
        if all > there.photons {
            let share = there.photons as f32 / all as f32;
            let more = self.bounced(k, 0..there.n, there.photons..all, asset)?;
            low.iter_mut().zip(&more).for_each(|(a, b)| *a = share * *a + (1.0 - share) * b);
        }
        if there.n == n {
            return Ok(low);
        }
        let high = self.bounced(k, there.n..n, 0..all, asset)?;
        let rows = low.chunks_exact(there.n).zip(high.chunks_exact(n - there.n));
        Ok(rows.flat_map(|(low, high)| [low, high].concat()).collect())
    }

    /// The bands that hold the share of the energy asked for, by the first bounce at a few vertices: later bounces
    /// carry less of the high bands.
    fn choose_order(&self, k: usize, asset: &Asset, report: &mut PortalReport) -> Result<usize, Error> {
        let most = self.options.indirect_order;
        let Some(share) = self.portal_options.energy_share else { return Ok(most) };
        let n_lit = self.unlit.iter().filter(|u| !**u).count();
        let every = n_lit.div_ceil(PROBED).max(1);
        let mut skip = vec![true; self.unlit.len()];
        (0..skip.len()).filter(|&v| !self.unlit[v]).step_by(every).for_each(|v| skip[v] = false);
        let columns = 0..most * most;
        let direct = self.direct_sh(k, &columns, asset);
        let bands = energy::bands(&self.gather(k, &columns, 1, &direct, &skip)?, most);
        let order = energy::order_for(&bands, share);
        report.lines.push(energy_line(&self.portals[k].name, &bands));
        report.lines.push(format!(
            "portal {}: {order} bands hold {:.1} % of it",
            self.portals[k].name,
            100.0 * energy::cumulative(&bands)[order - 1]
        ));
        Ok(order)
    }

    /// SH transfer of the direct light of portal `k`, \[V, columns\]: what its rows make of the basis functions.
    fn direct_sh(&self, k: usize, columns: &Columns, asset: &Asset) -> Vec<f32> {
        let n = columns.len();
        let table = ShTable::new(self.options.resolution, lunette_relight::sh::order_of(columns.end));
        let mut rows = vec![0.0; self.scene.mesh.position.len() * n];
        for first in columns.clone().step_by(3) {
            let three = first..columns.end.min(first + 3);
            let mean =
                |t| std::array::from_fn(|c| if c < three.len() { table.mean(first + c, t) } else { 0.0 });
            for (row, e) in rows.chunks_exact_mut(n).zip(self.response(k, asset, mean)) {
                row[first - columns.start..][..three.len()].copy_from_slice(&e[..three.len()]);
            }
        }
        rows
    }

    /// Bounced light of portal `k`, \[V, 3 columns\], red, green, blue, by gathering or by some of the photons.
    fn bounced(
        &self,
        k: usize,
        columns: Columns,
        photons: Range<u64>,
        asset: &Asset,
    ) -> Result<Vec<f32>, Error> {
        let mut rows = match self.portal_options.start {
            Start::Gathering => {
                let direct = self.direct_sh(k, &columns, asset);
                self.gather(k, &columns, self.options.bounces, &direct, &self.unlit)?
            }
            Start::Photons(_) => {
                let mut all = self.photons(k, &columns, photons)?;
                self.add_outer(k, &self.direct_sh(k, &columns, asset), &mut all);
                let before_last = if self.options.bounces > 1 { &all[..] } else { &[] };
                self.pass(k, &columns, (1, 1), (&all, before_last), &self.unlit)?
            }
        };
        self.smoother.apply(&mut rows, 3 * columns.len());
        Ok(rows)
    }

    /// Adds the sky's light on outer surfaces, which no photon of a portal brings there.
    fn add_outer(&self, k: usize, direct_sh: &[f32], rows: &mut [f32]) {
        let n = direct_sh.len() / self.owners.len();
        for (v, row) in rows.chunks_exact_mut(3 * n).enumerate().filter(|(v, _)| self.owners[*v] == k as u32)
        {
            for plane in row.chunks_exact_mut(n) {
                plane.iter_mut().zip(&direct_sh[v * n..][..n]).for_each(|(a, d)| *a += d);
            }
        }
    }

    /// As [`Work::bounced`], iterated from the direct light at the vertices.
    fn gather(
        &self,
        k: usize,
        columns: &Columns,
        bounces: usize,
        direct_sh: &[f32],
        skip: &[bool],
    ) -> Result<Vec<f32>, Error> {
        let n = columns.len();
        let mut last: Vec<f32> = direct_sh.chunks_exact(n).flat_map(|row| [row, row, row].concat()).collect();
        let mut before_last = Vec::new();
        for b in 1..=bounces {
            let rows = self.pass(k, columns, (b, bounces), (&last, &before_last), skip)?;
            if b == bounces {
                return Ok(rows);
            }
            let mut next = rows;
            for (row, direct) in next.chunks_exact_mut(3 * n).zip(direct_sh.chunks_exact(n)) {
                for plane in row.chunks_exact_mut(n) {
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
        columns: &Columns,
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
            order: 0,
            seed: hash(self.options.seed, b as u64),
            stage: &format!("portal {} of {}, bounce {b}", k + 1, self.portals.len()),
            total: (n_passes * n_vertices * rays) as u64,
            done: &AtomicU64::new(((b - 1) * n_vertices * rays) as u64),
        };
        let light = Arriving {
            columns: columns.clone(),
            last,
            before_last,
            many: None,
            escapes: &escapes,
            unlit: skip,
        };
        let mut rows = vec![0.0; n_vertices * 3 * columns.len()];
        bounced(&pass, &light, &mut rows, self.progress)?;
        self.donors.fill(&mut rows, 3 * columns.len());
        Ok(rows)
    }

    /// All light at the vertices but the last bounce, by some of the photons.
    fn photons(&self, k: usize, columns: &Columns, photons: Range<u64>) -> Result<Vec<f32>, Error> {
        let n = columns.len();
        let n_vertices = self.scene.mesh.position.len();
        let emission = Emission {
            surface: self.surface,
            gates: self.gates,
            portal: &self.portals[k],
            k: k as u32,
            columns: columns.clone(),
            hits: self.options.bounces,
            seed: self.options.seed,
        };
        let mut planes = [(); 3].map(|()| vec![0.0; n_vertices * n]);
        let area = self.scene.mesh.vertex_area();
        photon::trace(&emission, photons.start, photons.end, &area, &mut planes, self.progress)?;
        let per_photon = 1.0 / (photons.end - photons.start) as f32;
        let mut rows = Vec::with_capacity(3 * n_vertices * n);
        for v in 0..n_vertices {
            for plane in &planes {
                rows.extend(plane[v * n..][..n].iter().map(|x| x * per_photon));
            }
        }
        self.donors.fill(&mut rows, 3 * n);
        Ok(rows)
    }
}

fn energy_line(name: &str, bands: &[BandEnergy]) -> String {
    let shares: Vec<String> = energy::cumulative(bands).iter().map(|s| format!("{:.1}", 100.0 * s)).collect();
    format!(
        "portal {name}: % of the energy of bounced light in the first 1, 2, ... SH bands: {}",
        shares.join(" ")
    )
}
