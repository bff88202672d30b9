//! What lights an asset frame by frame: under the open sky, or through portals.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::Vec3;
use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::glossy::Glossy;
use lunette_relight::indirect::Indirect;
use lunette_relight::light::Light;
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::{Shell, parse_material};
use lunette_render::{Backdrop, Exterior, Pose, Surface, Through, Track, capture, seen_discs};

use crate::args;
use crate::moving::Moment;
use crate::progress::say;
use crate::scene;

/// A frame of either kind.
pub enum Engine<'a> {
    /// The sky is all around.
    Sky(Box<Frame<'a>>, Option<Indirect>),
    /// Light enters through portals.
    Interior(Box<Interior<'a>>),
}

/// A portal frame and what is outside.
pub struct Interior<'a> {
    frame: PortalFrame<'a>,
    centres: Vec<Vec3>,
    exterior: Option<(Exterior, Track)>,
    carried: Option<Indirect>,
    glossy: Option<Glossy<'a>>,
}

/// What a frame took.
pub struct Spent {
    /// Capture of shells and projection of the light.
    pub project: Duration,
    /// Dot products.
    pub dot: Duration,
    /// Lamps and blockers that move.
    pub moving: Duration,
}

impl Spent {
    /// The whole frame.
    pub fn all(&self) -> Duration {
        self.project + self.dot
    }
}

/// Irradiance of all vertices.
pub struct Evaluated {
    pub direct: Vec<[f32; 3]>,
    pub indirect: Vec<[f32; 3]>,
    /// Products of lobes, of lamps.
    pub products: Vec<u32>,
    pub spent: Spent,
}

impl<'a> Engine<'a> {
    /// An engine for an asset: `method` is the sky's, `outside` the interior's options.
    pub fn new(asset: &'a Asset<'a>, method: Option<Method>, outside: &args::Outside) -> Result<Engine<'a>> {
        if asset.metadata.shells.len() > 1 {
            ensure!(
                method.is_none(),
                "--method: this asset is lit through portals; choose --indirect instead"
            );
            return Ok(Engine::Interior(Box::new(Interior::new(asset, outside)?)));
        }
        ensure!(
            outside.portal_material.is_empty() && outside.exterior.is_none(),
            "this asset has no portals: --portal-material and --exterior need one baked with --portal"
        );
        let mut frame = Frame::new(asset, method.unwrap_or_default()).map_err(|e| anyhow!("{e}"))?;
        let carried = indirect(outside)?;
        if let Some(carried) = carried {
            frame.set_indirect(carried).map_err(|e| anyhow!("{e}"))?;
        }
        Ok(Engine::Sky(Box::new(frame), carried))
    }

    /// What a frame reads per vertex, bytes: direct and bounced light.
    pub fn bytes_per_vertex(&self) -> (f32, f32) {
        match self {
            Engine::Sky(frame, _) => frame.bytes_per_vertex(),
            Engine::Interior(interior) => interior.frame.bytes_per_vertex(),
        }
    }

    /// What pictures of the last frame are lit through, if there are portals, by the irradiance of all vertices.
    pub fn through(&mut self, irradiance: &[[f32; 3]]) -> Option<Through<'_>> {
        match self {
            Engine::Sky(..) => None,
            Engine::Interior(interior) => {
                if let Some(glossy) = &mut interior.glossy {
                    glossy.project(&interior.frame, irradiance);
                }
                Some(Through { frame: &interior.frame, glossy: interior.glossy.as_ref() })
            }
        }
    }

    /// The light of the last frame in the portals, if there are any.
    pub fn portals(&self) -> Option<&PortalFrame<'a>> {
        match self {
            Engine::Sky(..) => None,
            Engine::Interior(interior) => Some(&interior.frame),
        }
    }

    /// Irradiance of all vertices under a light and what moves, in frame `i` of `n`.
    pub fn light(
        &mut self,
        asset: &Asset,
        light: &Light,
        moment: &Moment,
        (i, n): (usize, usize),
    ) -> Result<Evaluated> {
        let n_vertices = asset.n_vertices();
        let (mut direct, mut indirect) = (vec![[0.0; 3]; n_vertices], vec![[0.0; 3]; n_vertices]);
        let mut products = vec![0; n_vertices];
        let started = Instant::now();
        let hidden = match self {
            Engine::Sky(frame, _) => moment.hidden(asset, light, |sun, out| {
                frame.project(sun);
                for_each_part(out, |first, out| frame.direct(first, out));
            }),
            Engine::Interior(_) => None,
        };
        let hiding = started.elapsed();
        let mut applying = Duration::ZERO;
        let mut apply = |direct: &mut [[f32; 3]]| {
            let started = Instant::now();
            moment.apply(asset, hidden.as_deref(), direct, &mut products);
            applying = started.elapsed();
        };
        let started = Instant::now();
        match self {
            Engine::Sky(frame, carried) => {
                if carried.is_none() {
                    let suits = Indirect::for_light(asset, light);
                    frame.set_indirect(suits).map_err(|e| anyhow!("{e}"))?;
                }
                frame.project(light);
            }
            Engine::Interior(interior) => interior.project(asset, light, i, n)?,
        }
        let project = started.elapsed();
        let started = Instant::now();
        match self {
            Engine::Sky(frame, _) => {
                for_each_part(&mut direct, |first, out| frame.direct(first, out));
                apply(&mut direct);
                frame.reflect_parallel(&direct);
                for_each_part(&mut indirect, |first, out| frame.add_indirect(first, out));
            }
            Engine::Interior(interior) => {
                let frame = &mut interior.frame;
                for_each_part(&mut direct, |first, out| frame.direct(first, out));
                apply(&mut direct);
                frame.reflect_parallel(&direct);
                for_each_part(&mut indirect, |first, out| frame.add_indirect(first, out));
            }
        }
        let spent = Spent { project, dot: started.elapsed() - applying, moving: hiding + applying };
        Ok(Evaluated { direct, indirect, products, spent })
    }
}

/// Vertices of one task.
const TASK: usize = 1024;

fn for_each_part(out: &mut [[f32; 3]], work: impl Fn(usize, &mut [[f32; 3]]) + Sync) {
    use rayon::prelude::*;
    out.par_chunks_mut(TASK).enumerate().for_each(|(task, out)| work(task * TASK, out));
}

/// `--indirect`, where given.
fn indirect(outside: &args::Outside) -> Result<Option<Indirect>> {
    Ok(match outside.indirect.as_deref() {
        None => None,
        Some("none") => Some(Indirect::None),
        Some("sh") => Some(Indirect::Sh),
        Some("direct-to-indirect") => Some(Indirect::DirectToIndirect),
        Some(other) => bail!("--indirect: there is no '{other}'; there are none, sh, direct-to-indirect"),
    })
}

impl<'a> Interior<'a> {
    fn new(asset: &'a Asset<'a>, outside: &args::Outside) -> Result<Interior<'a>> {
        let mut frame = PortalFrame::new(asset).map_err(|e| anyhow!("{e}"))?;
        for spec in &outside.portal_material {
            let (name, material) = parse_material(spec).map_err(|e| anyhow!("--portal-material: {e}"))?;
            let matching: Vec<usize> = (0..frame.n_portals()).filter(|&k| frame.name(k) == name).collect();
            let names: Vec<&str> = (0..frame.n_portals()).map(|k| frame.name(k)).collect();
            ensure!(
                !matching.is_empty(),
                "--portal-material: there is no portal '{name}'; there are {}",
                names.join(", ")
            );
            matching.into_iter().for_each(|k| frame.set_material(k, material));
        }
        let centres =
            asset.metadata.shells[1..].iter().map(|s| s.centre.unwrap_or_default().into()).collect();
        let exterior = match (&outside.exterior, &outside.along) {
            (Some(path), along) => Some(exterior(asset, path, along.as_deref())?),
            _ => None,
        };
        let glossy = Glossy::open(asset).map_err(|e| anyhow!("{e}"))?;
        Ok(Interior { frame, centres, exterior, carried: indirect(outside)?, glossy })
    }

    fn project(&mut self, asset: &Asset, light: &Light, i: usize, n: usize) -> Result<()> {
        let carried = self.carried.unwrap_or_else(|| Indirect::for_light(asset, light));
        if carried != self.frame.indirect() {
            self.frame.set_indirect(carried).map_err(|e| anyhow!("--indirect: {e}"))?;
        }
        if let Some((exterior, track)) = &mut self.exterior {
            let pose = Pose { position: track.at(i, n), ..Pose::default() };
            (0..exterior.n_objects())
                .try_for_each(|o| exterior.set_pose(o, pose))
                .map_err(|e| anyhow!("{e}"))?;
        }
        let mut backdrops: Vec<Backdrop> = Vec::new();
        let mut discs = Vec::new();
        for (k, &centre) in self.centres.iter().enumerate() {
            let side = self.frame.resolution(k);
            if !backdrops.iter().any(|b| b.n() == side) {
                backdrops.push(Backdrop::new(light, side).map_err(|e| anyhow!("{e}"))?);
            }
            let backdrop = backdrops.iter().find(|b| b.n() == side).context("no backdrop")?;
            let mut texels = vec![[0.0; 3]; 6 * side * side];
            let exterior = self.exterior.as_ref().map(|(e, _)| e);
            capture(backdrop, exterior, centre, &mut texels).map_err(|e| anyhow!("{e}"))?;
            seen_discs(backdrop, exterior, centre, &mut discs);
            let shell = Shell::new(side, &texels).map_err(|e| anyhow!("{e}"))?;
            self.frame.set_shell_with_discs(k, shell, &discs).map_err(|e| anyhow!("{e}"))?;
        }
        Ok(())
    }
}

/// The moving objects of `--exterior`, checked against the interior and its portals.
fn exterior(asset: &Asset, path: &str, along: Option<&str>) -> Result<(Exterior, Track)> {
    let track = match along {
        Some(text) => Track::parse(text).map_err(|e| anyhow!("--along: {e}"))?,
        None => Track { from: Vec3::ZERO, to: Vec3::ZERO },
    };
    let scene = scene::load_plain(path)?;
    let albedo = scene.vertex_albedo();
    let mesh = Surface {
        position: &scene.mesh.position,
        normal: &scene.mesh.normal,
        index: &scene.mesh.index,
        albedo: &albedo,
    };
    let mut exterior = Exterior::new(&[mesh]).map_err(|e| anyhow!("--exterior: {e}"))?;
    let position: &[Vec3] = bytemuck::cast_slice(asset.positions());
    let (low, high) =
        position.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    for at in [track.from, track.to] {
        exterior.set_pose(0, Pose { position: at, ..Pose::default() }).map_err(|e| anyhow!("{e}"))?;
        for overlap in exterior.overlaps(low, high) {
            say(&format!(
                "{path}: {:.2} m² of it lie inside the interior's box when it is at {at}",
                overlap.area
            ));
        }
    }
    Ok((exterior, track))
}
