//! Shells, captured: the radiance that arrives at a portal's centre, on an N x N x 6 cubemap.
//!
//! Texel t holds the average radiance over its solid angle, linear Rec.709, in the order of
//! [`cubemap`](lunette_relight::cubemap): faces +X -X +Y -Y +Z -Z, face N² + row N + column. Where rays from the centre
//! miss the [`Exterior`], that is the light itself, projected once and kept in a [`Backdrop`]; where they hit, it is what
//! the exterior sends out, and texels that are partly covered hold both by their shares:
//!
//! ```text
//! texel = (1 - covered) rest + Σ suns visible(sun, texel) share(sun, texel) + covered · mean of albedo/π E
//! ```
//!
//! Four rays per texel, in blocks of 2 x 2 texels; sixteen where a block is covered in part. Discs that are smaller than
//! [`SUN_RADIUS`] are either seen or hidden with rays of their own, however small a part of a texel they are. The samples
//! are the same in every frame: what stands still does not flicker. Capturing allocates nothing.
//!
//! Where it breaks: an object that all rays of a block miss (a pole thinner than half a texel) is not seen. Light from
//! the shell's own building is not in it. Bright spots of a picture are taken for discs.
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic Environment
//! Illumination, 2009, sec. 5.

use crate::error::Error;
use crate::exterior::{Exterior, N_SMOOTH};
use crate::reference::aim::uniform_cap;
use crate::reference::hash;
use crate::tracer::lambert;
use glam::{Vec2, Vec3};
use lunette_ffi::{Hits, Mask, NO_HIT, Packet, Ray};
use lunette_relight::cubemap::{self, RESOLUTIONS, n_texels, project_light, project_light_parallel};
use lunette_relight::light::{Cap, Light, SMOOTH_ORDER, Source, split};
use lunette_relight::sh;
use rayon::prelude::*;

/// Discs smaller than this, in radians, are hidden or seen by rays of their own; larger ones are broad against a texel
/// of any resolution.
const SUN_RADIUS: f32 = 0.2;

/// Rays at a sun's disc, a multiple of 16.
const SUN_RAYS: usize = 64;

/// Rays per packet.
const LANES: usize = 16;

/// A light, projected for captures at one resolution: made when the light changes, used in every frame.
pub struct Backdrop {
    n: usize,
    /// The light without its suns.
    rest: Vec<[f32; 3]>,
    suns: Vec<Sun>,
    /// What shines on the exterior: discs, and SH of the smooth rest.
    discs: Vec<Cap>,
    smooth: [[f32; 3]; N_SMOOTH],
}

/// A small disc, and its average radiance over each texel that it touches.
struct Sun {
    cap: Cap,
    shares: Vec<(usize, Vec3)>,
}

impl Backdrop {
    /// Projects a light to `n` x `n` x 6 texels.
    ///
    /// # Errors
    /// [`Error::Options`] for an `n` that is not in [`RESOLUTIONS`].
    pub fn new(light: &Light, n: usize) -> Result<Backdrop, Error> {
        if !RESOLUTIONS.contains(&n) {
            let (least, most) = (RESOLUTIONS.start(), RESOLUTIONS.end());
            let what = format!("shell: {n} texels along a side, must be {least} to {most}");
            return Err(Error::Options { what });
        }
        let mut discs = Vec::new();
        let smooth = split(light, &mut discs);
        let light = light.with_spots_as_discs();
        let mut rest = vec![[0.0; 3]; n_texels(n)];
        project_light_parallel(&light, n, &mut rest);
        let suns: Vec<Sun> = suns(&light).map(|cap| sun(cap, n)).collect();
        for (texel, share) in suns.iter().flat_map(|sun| &sun.shares) {
            // What rounding leaves of a sun may be below 0.
            rest[*texel] = (Vec3::from(rest[*texel]) - share).max(Vec3::ZERO).to_array();
        }
        Ok(Backdrop { n, rest, suns, discs, smooth })
    }

    /// Texels along a side of a face.
    pub fn n(&self) -> usize {
        self.n
    }
}

/// Captures the shell around `centre`: average radiance of each texel, \[6 n²\].
///
/// # Errors
/// [`Error::Options`] where `texels` has another length, or the centre is not finite.
pub fn capture(
    backdrop: &Backdrop,
    exterior: Option<&Exterior>,
    centre: Vec3,
    texels: &mut [[f32; 3]],
) -> Result<(), Error> {
    let n = backdrop.n;
    if texels.len() != n_texels(n) || !centre.is_finite() {
        let (found, expected) = (texels.len(), n_texels(n));
        let what = format!("shell around {centre}: {found} texels, needs {expected} and a finite centre");
        return Err(Error::Options { what });
    }
    texels.copy_from_slice(&backdrop.rest);
    let Some(exterior) = exterior.filter(|exterior| exterior.n_objects() > 0) else {
        backdrop.suns.iter().for_each(|sun| add_sun(sun, |_| 1.0, texels));
        return Ok(());
    };

    let view = View { backdrop, exterior, centre, lift: exterior.shadow_lift() };
    texels.par_chunks_mut(n * n).enumerate().for_each(|(face, texels)| {
        texels.par_chunks_mut(2 * n).enumerate().for_each(|(i, rows)| {
            lunette_ffi::flush_to_zero();
            capture_rows(&view, face * n * n + i * 2 * n, rows);
        });
    });
    backdrop.suns.iter().for_each(|sun| add_seen_sun(&view, sun, texels));
    Ok(())
}

/// Writes the small discs of the light (radius below 0.2 radians) as far as they are seen from `centre`, their
/// radiance multiplied by the part seen: what of a [`capture`] can be told to be sharper than its texels.
pub fn seen_discs(backdrop: &Backdrop, exterior: Option<&Exterior>, centre: Vec3, discs: &mut Vec<Cap>) {
    discs.clear();
    for sun in &backdrop.suns {
        let part = match exterior.filter(|exterior| exterior.n_objects() > 0) {
            Some(exterior) => {
                let samples = look_at_sun(exterior, centre, backdrop.n, sun);
                samples.iter().filter(|s| s.1).count() as f32 / SUN_RAYS as f32
            }
            None => 1.0,
        };
        if part > 0.0 {
            discs.push(Cap { radiance: sun.cap.radiance * part, ..sun.cap });
        }
    }
}

/// What is looked at, from where.
struct View<'a> {
    backdrop: &'a Backdrop,
    exterior: &'a Exterior,
    centre: Vec3,
    /// Of shadow rays above their surface, metres.
    lift: f32,
}

/// What rays see in one texel: weights are parts of its solid angle.
#[derive(Clone, Copy, Default)]
struct Seen {
    weight: f32,
    covered: f32,
    /// Radiance times weight, of what covers.
    radiance: Vec3,
}

/// One ray: its texel of those of a packet, its weight.
#[derive(Clone, Copy, Default)]
struct Sample {
    slot: usize,
    weight: f32,
    direction: Vec3,
}

/// Two rows of texels (or one, the last of an odd number), from texel `first` on.
fn capture_rows(view: &View, first: usize, rows: &mut [[f32; 3]]) {
    let (n, n_here) = (view.backdrop.n, rows.len());
    let mut frame = SmoothFrame::default();
    for column in (0..n).step_by(2) {
        let at = [column, column + 1, n + column, n + column + 1];
        let is_there = |i: usize| at[i] < n_here && (i.is_multiple_of(2) || column + 1 < n);
        let mut block = [Seen::default(); 4];
        look(view, &mut frame, &mut block, |i| {
            let slot = i / 4;
            is_there(slot).then(|| sample(n, first + at[slot], slot, i % 4, 2))
        });

        // Looked at again, more closely, where the block is covered in part.
        let (weight, covered) = block.iter().fold((0.0, 0.0), |(w, c), s| (w + s.weight, c + s.covered));
        if covered == 0.0 {
            continue;
        }
        let is_mixed = covered < weight;
        for slot in (0..4).filter(|&slot| is_there(slot)) {
            if is_mixed {
                let mut texel = [Seen::default()];
                look(view, &mut frame, &mut texel, |i| Some(sample(n, first + at[slot], 0, i, 4)));
                block[slot] = texel[0];
            }
            let seen = block[slot];
            let rest = Vec3::from(rows[at[slot]]) * (1.0 - seen.covered / seen.weight);
            rows[at[slot]] = (rest + seen.radiance / seen.weight).to_array();
        }
    }
}

/// Ray `i` of a `grid` x `grid` of them in a texel.
fn sample(n: usize, texel: usize, slot: usize, i: usize, grid: usize) -> Sample {
    let jitter = hash::uniform_2d(hash::mix([texel as u32, i as u32, grid as u32]));
    let within = (Vec2::new((i % grid) as f32, (i / grid) as f32) + jitter) / grid as f32;
    let (direction, weight) = cubemap::sample(n, texel, within);
    Sample { slot, weight, direction }
}

/// Traces a packet of rays and adds what they see to their slots.
fn look(view: &View, frame: &mut SmoothFrame, seen: &mut [Seen], ray: impl Fn(usize) -> Option<Sample>) {
    let samples: [Option<Sample>; LANES] = std::array::from_fn(ray);
    let mut rays = Packet::<LANES>::default();
    for (lane, sample) in samples.iter().enumerate() {
        if let Some(sample) = sample {
            rays.set(lane, &Ray::new(view.centre.to_array(), sample.direction.to_array()));
            seen[sample.slot].weight += sample.weight;
        }
    }
    let mut hits = Hits::default();
    let mask = Mask::from_fn(|lane| samples[lane].is_some());
    view.exterior.scene().intersect_packet(&mask, &mut rays, &mut hits);
    if hits.geometry.iter().all(|&g| g == NO_HIT) {
        return;
    }
    let radiance = radiance_of_hits(view, frame, &rays, &hits);
    for (lane, sample) in samples.iter().enumerate() {
        if let Some(sample) = sample.filter(|_| hits.geometry[lane] != NO_HIT) {
            seen[sample.slot].covered += sample.weight;
            seen[sample.slot].radiance += sample.weight * radiance[lane];
        }
    }
}

/// What the exterior sends out at each hit of a packet.
fn radiance_of_hits(
    view: &View,
    frame: &mut SmoothFrame,
    rays: &Packet<LANES>,
    hits: &Hits<LANES>,
) -> [Vec3; LANES] {
    let (mut normal, mut origin) = ([Vec3::ZERO; LANES], [Vec3::ZERO; LANES]);
    let (mut irradiance, mut albedo) = ([Vec3::ZERO; LANES], [Vec3::ZERO; LANES]);
    for lane in (0..LANES).filter(|&lane| hits.geometry[lane] != NO_HIT) {
        let d = Vec3::new(rays.direction_x[lane], rays.direction_y[lane], rays.direction_z[lane]);
        let n = Vec3::new(hits.normal_x[lane], hits.normal_y[lane], hits.normal_z[lane]).normalize_or(-d);
        normal[lane] = if n.dot(d) > 0.0 { -n } else { n };
        origin[lane] = view.centre + rays.tfar[lane] * d + view.lift * normal[lane];

        let object = hits.instance[lane] as usize;
        let light = frame.of(view, object);
        let object = &view.exterior.objects()[object];
        (irradiance[lane], albedo[lane]) = object.smooth_irradiance(hits.primitive[lane], light);
    }
    for (k, disc) in view.backdrop.discs.iter().enumerate() {
        add_disc(view, disc, k, &normal, &origin, &mut irradiance);
    }
    std::array::from_fn(|lane| lambert(albedo[lane], irradiance[lane]))
}

/// The smooth light in the frame of the object that was asked for last: neighbours mostly hit the same.
#[derive(Default)]
struct SmoothFrame {
    object: Option<usize>,
    light: [[f32; 3]; N_SMOOTH],
}

impl SmoothFrame {
    fn of(&mut self, view: &View, object: usize) -> &[[f32; 3]; N_SMOOTH] {
        if self.object != Some(object) {
            let to_object = view.exterior.objects()[object].pose.rotation.conjugate();
            sh::rotate(SMOOTH_ORDER, to_object, &view.backdrop.smooth, &mut self.light);
            self.object = Some(object);
        }
        &self.light
    }
}

/// Adds the irradiance by a disc of the light, one shadow ray for each lane that has a normal, to its own part of the
/// disc.
fn add_disc(
    view: &View,
    disc: &Cap,
    number: usize,
    normal: &[Vec3; LANES],
    origin: &[Vec3; LANES],
    irradiance: &mut [Vec3; LANES],
) {
    let towards: [Vec3; LANES] = std::array::from_fn(|lane| {
        let u = hash::stratified_2d(lane as u32, LANES as u32, number as u32);
        uniform_cap(disc.axis, disc.radius, u)
    });
    let mut rays = Packet::<LANES>::default();
    for lane in 0..LANES {
        rays.set(lane, &Ray::new(origin[lane].to_array(), towards[lane].to_array()));
    }
    let is_lit = |lane: usize| normal[lane].dot(towards[lane]) > 0.0;
    view.exterior.scene().occluded_packet(&Mask::from_fn(is_lit), &mut rays);
    let power = disc.radiance * disc.solid_angle();
    for lane in (0..LANES).filter(|&lane| is_lit(lane) && !rays.is_occluded(lane)) {
        irradiance[lane] += power * normal[lane].dot(towards[lane]);
    }
}

/// The small discs of a light.
fn suns(light: &Light) -> impl Iterator<Item = Cap> + '_ {
    light.discs().filter(|cap| cap.radius < SUN_RADIUS)
}

fn sun(cap: Cap, n: usize) -> Sun {
    let mut texels = vec![[0.0; 3]; n_texels(n)];
    project_light(&Light::new(Source::Cap(cap)), n, &mut texels);
    let touched = texels.iter().enumerate().filter(|(_, texel)| **texel != [0.0; 3]);
    Sun { cap, shares: touched.map(|(i, texel)| (i, Vec3::from(*texel))).collect() }
}

fn add_sun(sun: &Sun, visible: impl Fn(usize) -> f32, texels: &mut [[f32; 3]]) {
    for (texel, share) in &sun.shares {
        texels[*texel] = (Vec3::from(texels[*texel]) + share * visible(*texel)).to_array();
    }
}

/// Texel of each ray at a sun, and whether it gets there.
fn look_at_sun(exterior: &Exterior, centre: Vec3, n: usize, sun: &Sun) -> [(usize, bool); SUN_RAYS] {
    let mut samples = [(0, false); SUN_RAYS];
    for (first, chunk) in samples.chunks_mut(LANES).enumerate() {
        let mut rays = Packet::<LANES>::default();
        for (lane, sample) in chunk.iter_mut().enumerate() {
            let u = hash::stratified_2d((first * LANES + lane) as u32, SUN_RAYS as u32, 0);
            let d = uniform_cap(sun.cap.axis, sun.cap.radius, u);
            sample.0 = cubemap::texel_of(n, d);
            rays.set(lane, &Ray::new(centre.to_array(), d.to_array()));
        }
        exterior.scene().occluded_packet(&Mask::all(), &mut rays);
        chunk.iter_mut().enumerate().for_each(|(lane, sample)| sample.1 = !rays.is_occluded(lane));
    }
    samples
}

/// Adds what the centre sees of a sun, texel by texel.
fn add_seen_sun(view: &View, sun: &Sun, texels: &mut [[f32; 3]]) {
    let samples = look_at_sun(view.exterior, view.centre, view.backdrop.n, sun);
    // A texel that hardly touches the disc may have no ray: it then goes with the whole.
    let visible = |is_counted: &dyn Fn(usize) -> bool| {
        let counted = samples.iter().filter(|s| is_counted(s.0));
        let (n, n_seen) = counted.fold((0, 0), |(n, seen), s| (n + 1, seen + i32::from(s.1)));
        (n > 0).then(|| n_seen as f32 / n as f32)
    };
    let whole = visible(&|_| true).unwrap_or(0.0);
    add_sun(sun, |texel| visible(&|t| t == texel).unwrap_or(whole), texels);
}

#[cfg(test)]
mod tests;
