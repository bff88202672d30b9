//! Pictures with what moves in them.
//!
//! A blocker is drawn as its mesh. Lamps light it past the other blockers (its own spheres would shadow its skin), and
//! daylight falls on it as if it stood in the open; in an interior it takes the mean light of the vertices around it.

use anyhow::{Context, Result, anyhow};
use glam::Vec3;
use lunette_relight::asset::Asset;
use lunette_relight::bent::{BentLight, open_irradiance};
use lunette_relight::light::{Light, split};
use lunette_relight::lobe::{Blockers, Motion};
use lunette_render::{Camera, Image, Picture, Props, Surface, Through, Tracer, Visibility, count_picture};

use super::{Body, Moment, Moving};
use crate::args::PictureOptions;
use crate::stage::{self, Around};

/// A camera before a baked scene and all that moves.
pub struct Studio<'a> {
    asset: &'a Asset<'a>,
    moving: &'a Moving,
    options: &'a PictureOptions,
    camera: Camera,
    /// What each pixel sees, and which frame that was.
    seen: Option<(Visibility, usize)>,
}

/// The light of one frame.
pub struct Lit<'a> {
    /// Of the sky, or outside of the portals.
    pub light: &'a Light,
    /// What it shines through.
    pub through: Option<Through<'a>>,
    /// Irradiance of each vertex of the baked scene.
    pub total: &'a [[f32; 3]],
    /// Products of lobes of each vertex.
    pub products: &'a [u32],
    /// Frame `i` of `n`.
    pub frame: (usize, usize),
}

impl Lit<'_> {
    fn around(&self) -> Around<'_> {
        Around { light: self.light, through: self.through }
    }
}

impl<'a> Studio<'a> {
    /// The camera asked for, before the scene alone.
    pub fn new(asset: &'a Asset<'a>, moving: &'a Moving, options: &'a PictureOptions) -> Result<Studio<'a>> {
        let tracer = Tracer::new(stage::surface(asset)).map_err(|e| anyhow!("{e}"))?;
        let camera = stage::camera(options, &tracer)?;
        Ok(Studio { asset, moving, options, camera, seen: None })
    }

    /// Where the camera is.
    pub fn eye(&self) -> Vec3 {
        self.camera.eye
    }

    /// The picture of a frame, and, where asked for, that of its products.
    pub fn shoot(&mut self, moment: &Moment, lit: &Lit) -> Result<Image> {
        let surface = stage::surface(self.asset);
        if self.moving.is_empty() {
            let radiance = stage::radiance(&surface, lit.total);
            return stage::shade(self.look(&surface, 0)?, &surface, &radiance, lit.around());
        }
        let mut irradiance = lit.total.to_vec();
        let props = self.props(moment, lit, &mut irradiance);
        let frame = if self.moving.moves() { lit.frame.0 } else { 0 };
        let radiance = stage::radiance(&props.surface(), &irradiance);
        stage::shade(self.look(&props.surface(), frame)?, &props.surface(), &radiance, lit.around())
    }

    /// The products of each vertex in false colour; what moves is drawn with none.
    pub fn products(&mut self, moment: &Moment, lit: &Lit) -> Result<Picture> {
        let mut irradiance = lit.total.to_vec();
        let props = self.props(moment, lit, &mut irradiance);
        let frame = if self.moving.moves() { lit.frame.0 } else { 0 };
        let mut counts: Vec<Vec3> = lit.products.iter().map(|&n| Vec3::splat(n as f32)).collect();
        counts.resize(props.surface().position.len(), Vec3::ZERO);
        let seen = self.look(&props.surface(), frame)?;
        let image = seen.shade(&props.surface(), &counts, |_| Vec3::ZERO).map_err(|e| anyhow!("{e}"))?;
        count_picture(&image, &seen.coverage()).map_err(|e| anyhow!("{e}"))
    }

    fn look(&mut self, surface: &Surface, frame: usize) -> Result<&Visibility> {
        if self.seen.as_ref().is_none_or(|(_, of)| *of != frame) {
            let (w, h) = stage::size(self.options)?;
            let tracer = Tracer::new(*surface).map_err(|e| anyhow!("{e}"))?;
            let seen = lunette_render::trace(&tracer, &self.camera, w, h).map_err(|e| anyhow!("{e}"))?;
            self.seen = Some((seen, frame));
        }
        self.seen.as_ref().map(|(seen, _)| seen).context("no view")
    }

    /// The scene with bodies and lamps; their irradiance is added to that of the scene.
    fn props(&self, moment: &Moment, lit: &Lit, irradiance: &mut Vec<[f32; 3]>) -> Props {
        let mut props = Props::new(&stage::surface(self.asset));
        for (k, body) in self.moving.bodies.iter().enumerate() {
            let motion = moment.motions[k];
            let position: Vec<Vec3> =
                body.position.iter().map(|&p| motion.rotation * p + motion.translation).collect();
            let normal: Vec<Vec3> = body.normal.iter().map(|&n| motion.rotation * n).collect();
            let mut light = self.daylight(body, &motion, &normal, lit);
            let others = self.others(moment, k);
            let (p, n) = (bytemuck::cast_slice(&position), bytemuck::cast_slice(&normal));
            moment.add_lamps(&others, p, n, &mut light, &mut vec![0; position.len()]);
            irradiance.extend(light);
            props.add(&Surface {
                position: &position,
                normal: &normal,
                index: &body.index,
                albedo: &body.albedo,
            });
        }
        for lamp in &moment.lamps {
            let place = props.add_ball(lamp.centre, lamp.radius);
            // A white surface under π L sends out L.
            irradiance.resize(place.end, (std::f32::consts::PI * lamp.radiance).to_array());
        }
        props
    }

    fn others(&self, moment: &Moment, except: usize) -> Blockers {
        let mut others = Blockers::default();
        for (k, (body, motion)) in self.moving.bodies.iter().zip(&moment.motions).enumerate() {
            if k != except {
                others.push(&body.set, motion);
            }
        }
        others
    }

    /// Light from outside on a body.
    fn daylight(&self, body: &Body, motion: &Motion, normal: &[Vec3], lit: &Lit) -> Vec<[f32; 3]> {
        if self.asset.metadata.shells.len() > 1 {
            return vec![self.around(body, motion, lit.total); normal.len()];
        }
        let mut caps = Vec::new();
        let smooth = split(lit.light, &mut caps);
        let light = BentLight { caps: &caps, smooth: &smooth };
        normal.iter().map(|&n| open_irradiance(&light, n).to_array()).collect()
    }

    /// Mean irradiance of the vertices around a body, or of the nearest.
    fn around(&self, body: &Body, motion: &Motion, total: &[[f32; 3]]) -> [f32; 3] {
        let bound = body.set.bound();
        let centre = motion.rotation * bound.centre + motion.translation;
        let distance = |p: &[f32; 3]| Vec3::from(*p).distance(centre);
        let nearest = self.asset.positions().iter().map(distance).fold(f32::INFINITY, f32::min);
        let reach = (1.5 * bound.radius).max(1.01 * nearest);
        let near = self.asset.positions().iter().zip(total).filter(|(p, _)| distance(p) <= reach);
        let (sum, n) = near
            .fold((Vec3::ZERO, 0.0), |(sum, n), (_, e)| (sum + Vec3::from(*e).max(Vec3::ZERO), n + 1.0f32));
        (sum / n.max(1.0)).to_array()
    }
}
