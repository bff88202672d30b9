//! One frame of an interior lit through its portals.
//!
//! ```
//! # use lunette_relight::{asset::Asset, portal_frame::PortalFrame, shell::{Material, Shell}};
//! # fn relight(bytes: &[u8], texels: &[[f32; 3]], suns: &[lunette_relight::light::Cap], out: &mut [[f32; 3]]) -> Result<(), Box<dyn std::error::Error>> {
//! let asset = Asset::from_bytes(bytes)?;
//! let mut frame = PortalFrame::new(&asset)?;
//! frame.set_material(0, Material { tint: [1.0, 0.8, 0.6], frost: 0.2 }); // when the glass changes
//! let shell = Shell::new(frame.resolution(0), texels)?; // each time the light outside changes
//! frame.set_shell_with_discs(0, shell, suns)?; // which suns are in it, to be sharper than texels; may be none
//! frame.direct(0, out); // all vertices, or any slice of them, from any thread
//! frame.reflect(out); // does something only where bounced light is carried from direct light
//! frame.add_indirect(0, out);
//! # Ok(())
//! # }
//! ```
//!
//! E(v) = Σ over portals of < direct_k(v), shell_k > + bounced light, either Σ < indirect_k(v), SH of shell_k > or
//! carried from the direct light of all portals together ([`Carrier`]). A frame does not allocate; setting a frosted
//! material does, and more small discs than ever before.
//!
//! Beside its rows ([`sparse`](crate::sparse)) and SH, the asset may have of portal k
//!
//! | name | type | |
//! |---|---|---|
//! | `portal.k.corner` | f32 \[C,3\] | corners of convex polygons, metres, counter-clockwise as seen from inside |
//! | `portal.k.polygon` | u32 \[M+1\] | polygon i has the corners `polygon[i]..polygon[i + 1]` |
//! | `portal.k.reveal` | f32 \[C,S,4\] | how deep the wall is outside and inside of the edge from each corner to the next, in up to S steps ([`Reveal`]), metres; may be absent, or \[C,4\] |
//! | `portal.k.open` | u32 | vertices outside of it, which see the sky past it; rising |
//!
//! by which a sun is sharper than a texel ([`PortalFrame::set_shell_with_discs`]), and than the mesh ([`Detail`]).
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic
//! Environment Illumination, 2009.

use std::fmt;

use glam::{Vec2, Vec3};
use half::f16;

use crate::asset::{self, Asset};
use crate::block;
use crate::cubemap::{self, ShTable, add_disc, n_texels};
use crate::dot;
use crate::frame::Missing;
use crate::indirect::{Carrier, Indirect};
use crate::light::Cap;
use crate::sh::MAX_COEFFICIENTS;
use crate::shell::{Blur, Material, Shell, ShellError};
use crate::sparse::{Rows, SparseLight, Together};

mod beam;
mod point;
mod reveal;

pub(crate) use beam::Scratch;
use beam::{Beam, Panes, Receivers};
pub use point::{Detail, Point};
pub use reveal::{Pane, Reveal, plane_of};

/// Why an asset cannot be lit through portals.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PortalError {
    /// It was baked without any.
    NoPortals,
    /// A portal's rows are broken, which an asset that was read cannot have.
    Rows(asset::Error),
}

/// An asset, and the light of the moment in each of its portals.
pub struct PortalFrame<'a> {
    portals: Vec<PortalLight<'a>>,
    tables: Vec<ShTable>,
    carrier: Option<Carrier<'a>>,
    indirect: Indirect,
    n_vertices: usize,
    receivers: Receivers<'a>,
    falling: Falling,
}

/// Light of the moment on the glossy vertices.
#[derive(Default)]
struct Falling {
    /// All but the beams', and of one beam.
    rest: Vec<Vec3>,
    beam: Vec<Vec3>,
    /// By vertex, from the first glossy one to the last: what but the beams falls on each times its direction, of the sum of
    /// the colours.
    moment: Vec<[f32; 3]>,
}

struct PortalLight<'a> {
    name: String,
    rows: Rows<'a>,
    together: Together,
    light: SparseLight,
    /// The sum of the light's colours times its direction, where something is glossy.
    moment: Option<Moment>,
    lit: Lit,
    panes: Option<Panes<'a>>,
    /// As many beams as there have ever been, of which the first `n_beams` are lit.
    beams: Vec<Beam>,
    n_beams: usize,
    /// The discs of the shell, before the glass.
    discs: Vec<Cap>,
    /// What texels are without the beams.
    rest: Vec<[f32; 3]>,
    bounced: Option<Bounced<'a>>,
    material: Material,
    blur: Option<Blur>,
    /// The shell behind the glass, and the same as it was captured, so that glass may change by itself.
    texels: Vec<[f32; 3]>,
    captured: Vec<[f32; 3]>,
}

struct Moment {
    directions: Vec<Vec3>,
    texels: Vec<[f32; 3]>,
    light: SparseLight,
}

/// Whether there is anything to add up.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lit {
    Dark,
    Bright,
}

/// SH transfer of bounced light, and the light's coefficients times the tensor's scale.
struct Bounced<'a> {
    /// Index of the table for its resolution and order.
    table: usize,
    n: usize,
    rows: &'a [f16],
    scale: f32,
    light: [[f32; 3]; MAX_COEFFICIENTS],
}

impl<'a> PortalFrame<'a> {
    /// Opens all portals of an asset: all dark, glass as it was modelled, bounced light by SH where that is baked, else from
    /// direct light where that is.
    ///
    /// # Errors
    /// When the asset has no portals, or rows that do not hold together.
    pub fn new(asset: &'a Asset<'a>) -> Result<PortalFrame<'a>, PortalError> {
        let mut frame = PortalFrame {
            portals: Vec::new(),
            tables: Vec::new(),
            carrier: Carrier::open(asset)?,
            indirect: Indirect::None,
            n_vertices: asset.n_vertices(),
            receivers: Receivers::new(asset),
            falling: Falling::default(),
        };
        let order = block::order(asset.positions(), asset.normals());
        while let Some(rows) = Rows::open(asset, &format!("portal.{}.direct", frame.portals.len()))? {
            frame.add_portal(asset, rows, &order)?;
        }
        if frame.portals.is_empty() {
            return Err(PortalError::NoPortals);
        }
        frame.indirect = match (&frame.carrier, frame.portals.iter().any(|p| p.bounced.is_some())) {
            (_, true) => Indirect::Sh,
            (Some(_), false) => Indirect::DirectToIndirect,
            (None, false) => Indirect::None,
        };
        Ok(frame)
    }

    fn add_portal(
        &mut self,
        asset: &'a Asset<'a>,
        rows: Rows<'a>,
        order: &[u16],
    ) -> Result<(), asset::Error> {
        let (k, n) = (self.portals.len(), rows.n());
        let shell = asset.metadata.shells.get(k + 1);
        let dark = vec![[0.0; 3]; n_texels(n)];
        let bounced = self.bounced(asset, &format!("portal.{k}.indirect.sh"), n);
        self.portals.push(PortalLight {
            name: shell.map_or_else(|| format!("portal {k}"), |shell| shell.name.clone()),
            light: SparseLight::new(n),
            moment: self.carrier.as_ref().is_some_and(Carrier::has_shine).then(|| Moment::new(n)),
            lit: Lit::Dark,
            panes: Panes::open(asset, k)?,
            beams: Vec::new(),
            n_beams: 0,
            discs: Vec::new(),
            rest: dark.clone(),
            bounced,
            material: Material { tint: shell.and_then(|s| s.tint).unwrap_or([1.0; 3]), ..Material::CLEAR },
            blur: None,
            texels: dark.clone(),
            captured: dark,
            together: Together::new(&rows, order),
            rows,
        });
        Ok(())
    }

    fn bounced(&mut self, asset: &'a Asset<'a>, name: &str, n: usize) -> Option<Bounced<'a>> {
        let (rows, scale) = asset.half(name)?;
        let order = asset.order(name)?;
        let known = self.tables.iter().position(|table| table.n() == n && table.order() == order);
        let table = known.unwrap_or_else(|| {
            self.tables.push(ShTable::new(n, order));
            self.tables.len() - 1
        });
        Some(Bounced { table, n: order * order, rows, scale, light: [[0.0; 3]; MAX_COEFFICIENTS] })
    }

    /// Portals.
    pub fn n_portals(&self) -> usize {
        self.portals.len()
    }

    /// Name of portal `k`.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn name(&self, k: usize) -> &str {
        &self.portals[k].name
    }

    /// Texels on a side of the shell that portal `k` wants.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn resolution(&self, k: usize) -> usize {
        self.portals[k].rows.n()
    }

    /// Radiance of each texel of portal `k`'s shell behind its glass.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn texels(&self, k: usize) -> &[[f32; 3]] {
        &self.portals[k].texels
    }

    /// Radiance of each texel of portal `k`'s shell as it was given, before its glass.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn captured(&self, k: usize) -> &[[f32; 3]] {
        &self.portals[k].captured
    }

    /// The glass of portal `k`.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn material(&self, k: usize) -> Material {
        self.portals[k].material
    }

    /// V.
    pub fn n_vertices(&self) -> usize {
        self.n_vertices
    }

    /// How bounced light is carried.
    pub fn indirect(&self) -> Indirect {
        self.indirect
    }

    /// Chooses how bounced light is carried, see [`Indirect::for_shells`].
    ///
    /// # Errors
    /// When that was not baked.
    pub fn set_indirect(&mut self, indirect: Indirect) -> Result<(), Missing> {
        match indirect {
            Indirect::Sh if self.portals.iter().all(|p| p.bounced.is_none()) => {
                return Err(Missing { tensor: "portal.0.indirect.sh", basis: "sh" });
            }
            Indirect::DirectToIndirect if self.carrier.is_none() => return Err(Missing::carrier()),
            _ => {}
        }
        self.indirect = indirect;
        Ok(())
    }

    /// Changes the glass of portal `k` under the shell that it has. Allocates where it frosts.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn set_material(&mut self, k: usize, material: Material) {
        let portal = &mut self.portals[k];
        if material.frost != portal.material.frost {
            portal.blur = (material.frost > 0.0).then(|| Blur::new(portal.rows.n(), material.frost));
        }
        portal.material = material;
        portal.project(&self.tables);
    }

    /// Gives portal `k` the light outside of it, before its glass.
    ///
    /// # Errors
    /// When the shell's resolution is not the portal's.
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn set_shell(&mut self, k: usize, shell: Shell) -> Result<(), ShellError> {
        self.set_shell_with_discs(k, shell, &[])
    }

    /// As [`set_shell`](Self::set_shell), and tells which part of the shell's light comes from small discs, as a sun: of up
    /// to 0.125 radians each then shines through the portal's own outline, and not through whole texels. Their light is
    /// part of the shell, or what of it the portal's centre can see. Discs that are larger, or behind frosted glass, stay
    /// in their texels.
    ///
    /// # Errors
    /// As [`set_shell`](Self::set_shell).
    ///
    /// # Panics
    /// When there is no such portal.
    pub fn set_shell_with_discs(&mut self, k: usize, shell: Shell, discs: &[Cap]) -> Result<(), ShellError> {
        let portal = &mut self.portals[k];
        if shell.n() != portal.rows.n() {
            return Err(ShellError::Resolution { baked: portal.rows.n(), given: shell.n() });
        }
        portal.captured.copy_from_slice(shell.texels());
        portal.discs.clear();
        portal.discs.extend(discs.iter().filter(|disc| Beam::suits(disc)));
        portal.project(&self.tables);
        Ok(())
    }

    /// Writes the direct irradiance of the vertices from `first` on, through all portals.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn direct(&self, first: usize, out: &mut [[f32; 3]]) {
        out.fill([0.0; 3]);
        for portal in self.portals.iter().filter(|p| p.lit == Lit::Bright) {
            portal.together.add(&portal.rows, first, &portal.light, out);
            let mut scratch = Scratch::default();
            for shaft in portal.shafts(&self.receivers) {
                for (v, out) in (first..).zip(&mut *out) {
                    *out = (Vec3::from(*out) + shaft.irradiance(v, &mut scratch)).to_array();
                }
            }
        }
    }

    /// Light of portal `k` behind its glass without its beams, and those.
    pub(crate) fn apart(&self, k: usize) -> (&[[f32; 3]], impl Iterator<Item = Shaft<'_>>) {
        let portal = &self.portals[k];
        (portal.without_beams(), portal.shafts(&self.receivers))
    }

    /// Takes on the direct irradiance of all vertices, from which [`add_indirect`](Self::add_indirect) then carries
    /// bounced light, if that is how it is carried; else does nothing.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    pub fn reflect(&mut self, direct: &[[f32; 3]]) {
        self.shine(direct, |out, of| out.iter_mut().enumerate().for_each(|(i, out)| *out = of(i)));
        if let (Indirect::DirectToIndirect, Some(carrier)) = (self.indirect, &mut self.carrier) {
            carrier.reflect(direct);
        }
    }

    /// As [`reflect`](Self::reflect), over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    #[cfg(feature = "rayon")]
    pub fn reflect_parallel(&mut self, direct: &[[f32; 3]]) {
        use rayon::prelude::*;
        self.shine(direct, |out, of| {
            out.par_iter_mut().enumerate().with_min_len(256).for_each(|(i, out)| *out = of(i));
        });
        if let (Indirect::DirectToIndirect, Some(carrier)) = (self.indirect, &mut self.carrier) {
            carrier.reflect_parallel(direct);
        }
    }

    /// Tells the carrier what falls on glossy vertices, of whom `fill` asks for all at once.
    fn shine(&mut self, direct: &[[f32; 3]], fill: impl Fn(&mut [Vec3], &(dyn Fn(usize) -> Vec3 + Sync))) {
        if self.indirect != Indirect::DirectToIndirect {
            return;
        }
        let Some(shine) = self.carrier.as_mut().and_then(Carrier::shine) else { return };
        assert_eq!(direct.len(), self.n_vertices, "one direct irradiance per vertex");
        let lit = || self.portals.iter().filter(|p| p.lit == Lit::Bright);
        let n_beams = lit().map(|portal| portal.n_beams).max().unwrap_or(0);
        shine.clear(1 + n_beams);
        let Falling { rest, beam, moment } = &mut self.falling;
        rest.clear();
        rest.extend(shine.vertices().map(|v| Vec3::from(direct[v])));
        beam.resize(rest.len(), Vec3::ZERO);
        moment.resize(direct.len(), [0.0; 3]);
        let range = shine.vertices().next().unwrap_or(0)..shine.vertices().last().map_or(0, |v| v + 1);
        moment[range.clone()].fill([0.0; 3]);
        for portal in lit() {
            if let Some(light) = &portal.moment {
                portal.together.add(&portal.rows, range.start, &light.light, &mut moment[range.clone()]);
            }
            for (j, shaft) in portal.shafts(&self.receivers).enumerate() {
                fill(beam, &|i| shaft.irradiance(shine.vertex(i), &mut Scratch::default()));
                rest.iter_mut().zip(&*beam).for_each(|(rest, beam)| *rest -= *beam);
                shine.add(1 + j, |i, _| (beam[i], beam[i].element_sum() * shaft.axis()));
            }
        }
        shine.add_rest(rest, moment);
    }

    /// Adds the irradiance of light that has bounced to the vertices from `first` on; nothing where none is baked.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add_indirect(&self, first: usize, out: &mut [[f32; 3]]) {
        match self.indirect {
            Indirect::None => {}
            Indirect::Sh => {
                let lit = self.portals.iter().filter(|p| p.lit == Lit::Bright);
                for bounced in lit.filter_map(|p| p.bounced.as_ref()) {
                    let row = 3 * bounced.n;
                    let rows = &bounced.rows[first * row..(first + out.len()) * row];
                    dot::sh_rgb_add(rows, &bounced.light[..bounced.n], out);
                }
            }
            Indirect::DirectToIndirect => {
                if let Some(carrier) = &self.carrier {
                    carrier.add(first, out);
                }
            }
        }
    }

    /// Writes the irradiance of all vertices, over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `out` is not one value per vertex.
    #[cfg(feature = "rayon")]
    pub fn irradiance_parallel(&mut self, out: &mut [[f32; 3]]) {
        use rayon::prelude::*;
        assert_eq!(out.len(), self.n_vertices, "one irradiance per vertex");
        let task = dot::ROWS_PER_TASK;
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| self.direct(i * task, out));
        self.reflect_parallel(out);
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| self.add_indirect(i * task, out));
    }

    /// What the file holds for a frame, bytes per vertex in the mean: (direct, bounced).
    pub fn bytes_per_vertex(&self) -> (f32, f32) {
        let direct: usize = self.portals.iter().map(|p| p.rows.bytes()).sum();
        let bounced = match self.indirect {
            Indirect::None => 0.0,
            Indirect::Sh => {
                self.portals.iter().filter_map(|p| p.bounced.as_ref()).map(|b| (6 * b.n) as f32).sum()
            }
            Indirect::DirectToIndirect => self.carrier.as_ref().map_or(0.0, Carrier::bytes_per_vertex),
        };
        (direct as f32 / self.n_vertices.max(1) as f32, bounced)
    }

    /// What a frame reads of direct rows, bytes per vertex in the mean: of sixteen neighbours in a block all that any of
    /// them has.
    pub fn direct_bytes_read(&self) -> f32 {
        let bytes: usize = self.portals.iter().map(|p| p.together.bytes(&p.rows)).sum();
        bytes as f32 / self.n_vertices.max(1) as f32
    }
}

/// That the outlines of all portals hold together.
pub(crate) fn check(asset: &Asset) -> Result<(), asset::Error> {
    (0..asset.metadata.shells.len()).try_for_each(|k| Panes::open(asset, k).map(|_| ()))
}

/// A beam of one portal.
pub(crate) struct Shaft<'a> {
    beam: &'a Beam,
    receivers: &'a Receivers<'a>,
    panes: &'a Panes<'a>,
    rows: &'a Rows<'a>,
    /// Behind the glass.
    radiance: Vec3,
}

impl Shaft<'_> {
    /// Direction to the disc.
    pub fn axis(&self) -> Vec3 {
        self.beam.axis()
    }

    /// Its irradiance of vertex `v`.
    pub fn irradiance(&self, v: usize, scratch: &mut Scratch) -> Vec3 {
        self.beam.transfer(v, self.receivers, (self.panes, self.rows), scratch) * self.radiance
    }
}

impl Moment {
    fn new(n: usize) -> Moment {
        let direction = |t: usize| cubemap::direction(n, t, Vec2::splat(0.5));
        let directions: Vec<Vec3> = (0..n_texels(n)).map(direction).collect();
        Moment { texels: vec![[0.0; 3]; directions.len()], directions, light: SparseLight::new(n) }
    }

    fn set(&mut self, texels: &[[f32; 3]]) {
        for ((to, d), texel) in self.texels.iter_mut().zip(&self.directions).zip(texels) {
            *to = (*d * texel.iter().sum::<f32>()).to_array();
        }
        self.light.set(&self.texels);
    }
}

impl PortalLight<'_> {
    /// The beams, as they fall on vertices.
    fn shafts<'s>(&'s self, receivers: &'s Receivers<'s>) -> impl Iterator<Item = Shaft<'s>> {
        let tint = Vec3::from(self.material.tint);
        let panes = self.panes.as_ref();
        self.beams[..self.n_beams].iter().filter_map(move |beam| {
            Some(Shaft { beam, receivers, panes: panes?, rows: &self.rows, radiance: beam.radiance() * tint })
        })
    }

    /// What texels hold beside the beams.
    fn without_beams(&self) -> &[[f32; 3]] {
        if self.n_beams > 0 { &self.rest } else { &self.texels }
    }

    /// Discs into beams, and `rest` without them.
    fn project_beams(&mut self) {
        if self.panes.is_none() || self.blur.is_some() {
            return;
        }
        let n = self.rows.n();
        if self.beams.len() < self.discs.len() {
            self.beams.resize_with(self.discs.len(), Beam::new);
        }
        self.rest.fill([0.0; 3]);
        for (beam, disc) in self.beams.iter_mut().zip(&self.discs) {
            beam.set(disc, n);
            add_disc(n, disc, None, &mut self.rest);
        }
        self.n_beams = self.discs.len();
        for (rest, texel) in self.rest.iter_mut().zip(&self.texels) {
            // What rounding leaves of a sun may be below 0.
            let without = Vec3::from(*texel) - Vec3::from(*rest) * Vec3::from(self.material.tint);
            *rest = without.max(Vec3::ZERO).to_array();
        }
    }

    /// Captured shell -> through the glass -> into all bases.
    fn project(&mut self, tables: &[ShTable]) {
        match &mut self.blur {
            Some(blur) => blur.apply(&self.captured, &mut self.texels),
            None => self.texels.copy_from_slice(&self.captured),
        }
        if self.material.tint != [1.0; 3] {
            for texel in &mut self.texels {
                for (l, t) in texel.iter_mut().zip(self.material.tint) {
                    *l *= t;
                }
            }
        }
        let is_dark = self.texels.as_flattened().iter().all(|l| *l == 0.0);
        self.lit = if is_dark { Lit::Dark } else { Lit::Bright };
        self.n_beams = 0;
        if is_dark {
            return;
        }
        self.project_beams();
        let rest = if self.n_beams > 0 { &self.rest } else { &self.texels };
        self.light.set(rest);
        if let Some(moment) = &mut self.moment {
            moment.set(rest);
        }
        if let Some(bounced) = &mut self.bounced {
            tables[bounced.table].project(&self.texels, &mut bounced.light);
            for l in bounced.light[..bounced.n].as_flattened_mut() {
                *l *= bounced.scale;
            }
        }
    }
}

impl From<asset::Error> for PortalError {
    fn from(error: asset::Error) -> PortalError {
        PortalError::Rows(error)
    }
}

impl fmt::Display for PortalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PortalError::NoPortals => write!(f, "the asset has no portals; bake it with --portal GLOB"),
            PortalError::Rows(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for PortalError {}

#[cfg(test)]
mod tests;
