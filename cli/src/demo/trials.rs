//! All methods under one light after the other, against the reference.

use anyhow::{Result, anyhow};
use lunette_bake::{Options, PortalOptions};
use lunette_relight::asset::Asset;
use lunette_relight::light::Light;
use lunette_render::{Exposure, ReferenceOptions, Through, Tracer, auto_exposure};

use super::chapters::{Kind, Trial};
use super::{Desk, Shown, Tried};
use crate::args::Outside;
use crate::compare::{self, Work};
use crate::engine::Engine;
use crate::judge::{self, Judge};
use crate::progress::say;
use crate::stage::Around;
use crate::{light, output, relight, render};

/// Methods of the tables under the open sky; inside they are those of `lunette compare`.
const METHODS: [&str; 7] = ["bent", "aperture", "aperture-smooth", "sh3", "sh5", "sh10", "sh10-lanczos"];

/// Methods of which a trial shows pictures.
const SHOWN: [&str; 6] = ["aperture", "sh5", "sh10", "sh10-lanczos", "portal-sh4", "portal-d2i"];

/// Bands of bounced light of plain precomputed radiance transfer inside.
const INDIRECT_ORDER: usize = 5;

/// A light, its reference, and what has been found so far.
struct Session {
    light: Light,
    judge: Judge,
    exposure: Exposure,
    tried: Tried,
}

/// Holds all trials of a chapter.
pub fn hold(desk: &Desk) -> Result<Vec<Tried>> {
    let mut sessions =
        desk.chapter.trials.iter().map(|trial| open(desk, trial)).collect::<Result<Vec<_>>>()?;
    if sessions.is_empty() {
        return Ok(Vec::new());
    }
    match desk.chapter.kind {
        Kind::OpenSky => {
            for name in METHODS {
                let mut engine = Engine::new(desk.asset, Some(relight::method(name)?), &Outside::default())?;
                for session in &mut sessions {
                    session.hear(desk, desk.asset, (name, &mut engine), desk.bake_seconds)?;
                }
            }
        }
        Kind::Interior => inside(desk, &mut sessions)?,
    }
    Ok(sessions.into_iter().map(|session| session.tried).collect())
}

/// Each method's own bake, under all lights.
fn inside(desk: &Desk, sessions: &mut [Session]) -> Result<()> {
    let effort = Options { indirect_order: INDIRECT_ORDER, bounces: bounces(desk), ..desk.options.clone() };
    let portal_options = PortalOptions::default();
    let work =
        Work { scene: desk.scene, portals: desk.portals, effort: &effort, portal_options: &portal_options };
    for (name, candidate) in compare::candidates(&compare::INSIDE.map(String::from))? {
        let started = std::time::Instant::now();
        let bytes = work.bake(candidate)?.to_bytes().map_err(|e| anyhow!("{e}"))?;
        let seconds = started.elapsed().as_secs_f64();
        let asset = Asset::from_bytes(&bytes).map_err(|e| anyhow!("{e}"))?;
        let mut engine = compare::engine(&asset, candidate)?;
        for session in &mut *sessions {
            session.hear(desk, &asset, (&name, &mut engine), seconds)?;
        }
    }
    Ok(())
}

/// Inside as many as there are, since light that is carried from direct light follows them all.
fn bounces(desk: &Desk) -> usize {
    match desk.chapter.kind {
        Kind::OpenSky => desk.options.bounces,
        Kind::Interior => compare::ALL_BOUNCES,
    }
}

/// Traces a trial's reference, and its picture where the trial has pictures.
fn open(desk: &Desk, trial: &'static Trial) -> Result<Session> {
    say(&format!("{}: reference under {}", desk.chapter.scene, trial.light));
    let light = light::parse(trial.light, desk.scene.mesh.bounds())?;
    let albedo = desk.scene.vertex_albedo();
    let tracer: Tracer = render::tracer(render::surface(desk.scene, &albedo), desk.portals)?;
    let samples = ReferenceOptions { samples: trial.samples, bounces: bounces(desk) as u32, seed: 1 };
    let judge = Judge::new(desk.scene, &tracer, &light, &samples, trial.stride, desk.portals)?;
    let tried = Tried { trial, rows: Vec::new(), judge: judge.describe(), pictures: Vec::new() };
    let mut session = Session { light, judge, exposure: Exposure::Auto, tried };
    if let Some(paths) = trial.pictures {
        let samples = ReferenceOptions { samples: paths, ..samples };
        let truth = render::vertices(&tracer, &session.light, &samples)?.total();
        session.picture(desk, "reference", bytemuck::cast_slice(&truth), None)?;
    }
    Ok(session)
}

impl Session {
    fn hear(
        &mut self,
        desk: &Desk,
        asset: &Asset,
        (name, engine): (&str, &mut Engine),
        bake_seconds: f64,
    ) -> Result<()> {
        let (row, total) = judge::measure(asset, (name, engine), bake_seconds, &self.light, &self.judge)?;
        if self.tried.trial.pictures.is_some() && SHOWN.contains(&name) {
            self.picture(desk, name, &total, engine.through(&total))?;
        }
        self.tried.rows.push(row);
        Ok(())
    }

    /// The first one, the reference, exposes all.
    fn picture(
        &mut self,
        desk: &Desk,
        name: &str,
        irradiance: &[[f32; 3]],
        through: Option<Through>,
    ) -> Result<()> {
        let image = desk.shade(irradiance, Around { light: &self.light, through })?;
        if self.exposure == Exposure::Auto {
            self.exposure = Exposure::Stops(auto_exposure(&image));
        }
        let file = format!("{}-{name}.png", desk.chapter.name());
        output::picture(&desk.folder.join(&file), &image, self.exposure)?;
        self.tried.pictures.push(Shown { file, caption: name.into() });
        Ok(())
    }
}
