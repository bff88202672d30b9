//! Lamps and blockers that move over a baked scene: `--lamp` and `--blocker`.
//!
//! Lamps add direct light to every vertex, past the blockers' spheres (`lunette_relight::lobe`). Blockers also shadow
//! the suns of the baked light. They do not shadow its sky, nor light that comes through portals, and what is baked
//! does not shadow the lamps. Lamp light bounces where the bounce is carried from direct light.

mod draw;
mod parse;

use anyhow::{Context, Result, anyhow, bail, ensure};
use glam::{Quat, Vec3};
use lunette_bake::{SphereOptions, fit_spheres};
use lunette_relight::asset::Asset;
use lunette_relight::light::{Light, Source, split};
use lunette_relight::lobe::{
    Blockers, Lamp, Motion, Options, Points, Policy, Scene, Scratch, Sphere, SphereSet, Sun, Target,
    add_irradiance,
};
use rayon::prelude::*;

use crate::args;
use crate::progress::say;
use crate::scene;

pub use draw::{Lit, Studio};
use parse::{MovingBody, MovingLamp, Place};

/// More lamps than anybody lists by hand.
const MOST_LAMPS: usize = 1000;
/// Most frames of a way.
pub const MOST_FRAMES: usize = 100_000;
/// Vertices of one task.
const TASK: usize = 4096;

/// All that moves.
pub struct Moving {
    lamps: Vec<MovingLamp>,
    bodies: Vec<Body>,
    options: Options,
}

/// A blocker at rest: its mesh, to be seen, and its spheres, to cast shadows.
struct Body {
    spec: MovingBody,
    position: Vec<Vec3>,
    normal: Vec<Vec3>,
    index: Vec<[u32; 3]>,
    albedo: Vec<Vec3>,
    set: SphereSet,
    /// How well the spheres fit.
    report: String,
}

/// All that moves, as it stands in one frame; by default nothing does.
#[derive(Default)]
pub struct Moment {
    lamps: Vec<Lamp>,
    motions: Vec<Motion>,
    blockers: Blockers,
    options: Options,
}

impl Moving {
    /// Reads the options, loads the meshes and fits spheres to them.
    pub fn new(options: &args::Moving) -> Result<Moving> {
        let lamps: Vec<MovingLamp> =
            options.lamp.iter().map(|text| parse::lamp(text)).collect::<Result<_>>()?;
        ensure!(lamps.len() <= MOST_LAMPS, "--lamp: {} lamps are more than {MOST_LAMPS}", lamps.len());
        let bodies: Vec<MovingBody> =
            options.blocker.iter().map(|text| parse::blocker(text)).collect::<Result<_>>()?;
        let most = SphereSet::MAX_SPHERES;
        ensure!(
            bodies.len().saturating_mul(options.spheres) <= most,
            "--blocker: {} blockers of {} spheres are more than {most} spheres; give fewer by --spheres",
            bodies.len(),
            options.spheres
        );
        let policy = match options.mask.as_str() {
            "aggressive" => Policy::Aggressive,
            "conservative" => Policy::Conservative,
            _ => Policy::Proportional,
        };
        let lobes = Options { depth: options.mask_depth, policy, threshold: options.threshold };
        lobes.check().map_err(|e| anyhow!("--mask-depth, --threshold: {e}"))?;
        let bodies =
            bodies.into_iter().map(|spec| Body::load(spec, options.spheres)).collect::<Result<_>>()?;
        Ok(Moving { lamps, bodies, options: lobes })
    }

    /// Whether there is neither lamp nor blocker.
    pub fn is_empty(&self) -> bool {
        self.lamps.is_empty() && self.bodies.is_empty()
    }

    /// Says how well the spheres fit.
    pub fn report(&self) {
        self.bodies.iter().for_each(|body| say(&body.report));
    }

    /// Whether frames differ.
    pub fn moves(&self) -> bool {
        self.lamps.iter().any(|l| l.to != l.lamp.centre)
            || self.bodies.iter().any(|b| b.spec.from != b.spec.to)
    }

    /// Where all stand in frame `i` of `n`.
    pub fn at(&self, i: usize, n: usize) -> Moment {
        let t = if n > 1 { i as f32 / (n - 1) as f32 } else { 0.0 };
        let lamp = |l: &MovingLamp| Lamp { centre: l.lamp.centre.lerp(l.to, t), ..l.lamp };
        let motion = |body: &Body| motion(&body.spec, t);
        let motions: Vec<Motion> = self.bodies.iter().map(motion).collect();
        let mut blockers = Blockers::default();
        self.bodies.iter().zip(&motions).for_each(|(body, motion)| blockers.push(&body.set, motion));
        Moment { lamps: self.lamps.iter().map(lamp).collect(), motions, blockers, options: self.options }
    }

    /// That in none of `n` frames a blocker swallows the scene, or a blocker or lamp the camera.
    pub fn check(&self, asset: &Asset, eye: Option<Vec3>, n: usize) -> Result<()> {
        for i in 0..if self.moves() { n } else { 1 } {
            let moment = self.at(i, n);
            for (body, motion) in self.bodies.iter().zip(&moment.motions) {
                let name = &body.spec.scene;
                if let Some(eye) = eye.filter(|&eye| body.holds(motion, eye)) {
                    bail!("--blocker {name}: swallows the camera at {eye} in frame {i}; move one of them");
                }
                if asset.positions().iter().all(|&p| body.holds(motion, p.into())) {
                    bail!(
                        "--blocker {name}: swallows the whole scene in frame {i}; make it smaller, or move it"
                    );
                }
            }
            if let Some((k, _)) = moment
                .lamps
                .iter()
                .enumerate()
                .find(|(_, l)| eye.is_some_and(|e| e.distance(l.centre) <= l.radius))
            {
                bail!(
                    "--lamp {}: swallows the camera in frame {i}; move one of them",
                    self.lamps[k].lamp.centre
                );
            }
        }
        Ok(())
    }
}

impl Body {
    fn load(spec: MovingBody, n_spheres: usize) -> Result<Body> {
        let name = spec.scene.clone();
        let mut scene = scene::load_plain(&name).with_context(|| "--blocker".to_string())?;
        scene.mesh.position.iter_mut().for_each(|p| *p *= spec.scale);
        let options = SphereOptions { n_spheres, ..SphereOptions::default() };
        let fit = fit_spheres(&scene.mesh.position, &scene.mesh.index, &options)
            .map_err(|e| anyhow!("--blocker {name}: {e}"))?;
        let report = format!(
            "{name}: {} spheres, {:.1} % of the volume too much, {:.1} % missing",
            fit.set.spheres().len(),
            100.0 * fit.outside,
            100.0 * fit.missing
        );
        let albedo = scene.vertex_albedo();
        let normal = scene.mesh.normal.iter().map(|n| n.normalize_or(Vec3::Y)).collect();
        Ok(Body {
            spec,
            position: scene.mesh.position,
            normal,
            index: scene.mesh.index,
            albedo,
            set: fit.set,
            report,
        })
    }

    /// Whether a point lies in one of the spheres.
    fn holds(&self, motion: &Motion, point: Vec3) -> bool {
        let local = motion.rotation.inverse() * (point - motion.translation);
        let inside = |s: &Sphere| s.centre.distance_squared(local) < s.radius * s.radius;
        inside(&self.set.bound()) && self.set.spheres().iter().any(inside)
    }
}

fn motion(spec: &MovingBody, t: f32) -> Motion {
    let mix = |from: f32, to: f32| from + t * (to - from);
    let place = Place {
        position: spec.from.position.lerp(spec.to.position, t),
        turn: mix(spec.from.turn, spec.to.turn),
    };
    Motion { rotation: Quat::from_rotation_y(-place.turn.to_radians()), translation: place.position }
}

impl Moment {
    /// Whether there is neither lamp nor blocker.
    pub fn is_empty(&self) -> bool {
        self.lamps.is_empty() && self.blockers.is_empty()
    }

    /// The bodies.
    pub fn blockers(&self) -> &Blockers {
        &self.blockers
    }

    /// Irradiance that the blockers take from the suns of a light, per vertex; none where there is no sun or no
    /// blocker. `direct` writes the baked direct irradiance under a light.
    pub fn hidden(
        &self,
        asset: &Asset,
        light: &Light,
        mut direct: impl FnMut(&Light, &mut [[f32; 3]]),
    ) -> Option<Vec<[f32; 3]>> {
        if self.blockers.is_empty() {
            return None;
        }
        let mut discs = Vec::new();
        split(light, &mut discs);
        let mut hidden: Option<Vec<[f32; 3]>> = None;
        let within = ball_around(asset);
        let mut alone = vec![[0.0; 3]; asset.n_vertices()];
        for disc in discs {
            let Some(sun) = Sun::new(&disc, within, &mut Scratch::default()) else { continue };
            direct(&Light::new(Source::Cap(disc)), &mut alone);
            let hidden = hidden.get_or_insert_with(|| vec![[0.0; 3]; asset.n_vertices()]);
            let tasks = hidden
                .par_chunks_mut(TASK)
                .zip(alone.par_chunks(TASK))
                .zip(asset.positions().par_chunks(TASK));
            tasks.for_each_init(Scratch::default, |scratch, ((hidden, alone), position)| {
                let mut part = vec![0.0; position.len()];
                sun.visible_part(position, &self.blockers, &self.options, scratch, &mut part);
                for ((hidden, alone), part) in hidden.iter_mut().zip(alone).zip(part) {
                    (0..3).for_each(|c| hidden[c] += (1.0 - part) * alone[c]);
                }
            });
        }
        hidden
    }

    /// Takes away what blockers hide, adds the lamps, and counts each vertex's products of lobes.
    pub fn apply(
        &self,
        asset: &Asset,
        hidden: Option<&[[f32; 3]]>,
        direct: &mut [[f32; 3]],
        products: &mut [u32],
    ) {
        for (direct, hidden) in direct.iter_mut().zip(hidden.unwrap_or_default()) {
            for (direct, hidden) in direct.iter_mut().zip(hidden) {
                // Light that was not negative stays so.
                *direct = (*direct - hidden).max(direct.min(0.0));
            }
        }
        self.add_lamps(&self.blockers, asset.positions(), asset.normals(), direct, products);
    }

    fn add_lamps(
        &self,
        blockers: &Blockers,
        position: &[[f32; 3]],
        normal: &[[f32; 3]],
        light: &mut [[f32; 3]],
        products: &mut [u32],
    ) {
        if self.lamps.is_empty() {
            return;
        }
        let scene = Scene { lamps: &self.lamps, blockers };
        let out = light.par_chunks_mut(TASK).zip(products.par_chunks_mut(TASK));
        let points = position.par_chunks(TASK).zip(normal.par_chunks(TASK));
        out.zip(points).for_each_init(
            Scratch::default,
            |scratch, ((light, products), (position, normal))| {
                let mut target = Target { light, products: Some(products) };
                add_irradiance(&Points { position, normal }, &scene, &self.options, scratch, &mut target);
            },
        );
    }

    /// What there is, in words.
    pub fn describe(&self, products: &[u32]) -> String {
        let mean = products.iter().map(|&n| f64::from(n)).sum::<f64>() / products.len().max(1) as f64;
        let [lamps, bodies] = [(self.lamps.len(), "lamp"), (self.motions.len(), "blocker")]
            .map(|(n, what)| format!("{n} {what}{}", if n == 1 { "" } else { "s" }));
        format!("{lamps} and {bodies}, {mean:.1} products of lobes per vertex")
    }
}

/// A sphere around a scene.
fn ball_around(asset: &Asset) -> Sphere {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) =
        asset.positions().iter().fold(start, |(lo, hi), &p| (lo.min(p.into()), hi.max(p.into())));
    Sphere { centre: 0.5 * (low + high), radius: 0.5 * low.distance(high) }
}
