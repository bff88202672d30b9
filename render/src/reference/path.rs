//! One path, and the light it brings.
//!
//! What a point sends out is `L_o = ∫ f(w) L_i(w) max(n.w, 0) dw`, where `L_i` is the light's radiance if nothing is in
//! the way, else what the point in the way sends out. At each point x directions d to the light are drawn by several
//! techniques: one from the reflection's own lobe ([`Scatter`]), which also is the way on if it hits a surface; one
//! from each [`Aim`]; and one to the openings ([`Panes`]), if there are any. With openings there is, for each peaked aim, also a
//! *beam*: a direction d to the light and a point on a pane are drawn, followed in to the point y that they light, and
//! y is joined with x; this finds the bright patches behind small windows, which paths from x would find by chance.
//!
//! All that can find the same light are weighed with the balance heuristic. Straight light at x:
//!
//! ```text
//! f L cos / D(x, d)                         D = lobe + Σ aims + panes, densities at x of d, 1/sr
//! ```
//!
//! Light that x gets by way of y, r apart, with cos_y the cosine at y towards x and θ at y towards d: a path from x that
//! hit y divides by `D(y, d) + beams(y, d) r² / (p(x → y) cos_y)` instead, a beam by
//! `beams(y, d) + p(x → y) cos_y / r² D(y, d)`, with `beams = Σ aims(d) beam(y) cosθ` in 1/(sr m²).
//!
//! Based on: Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, ch. 9 and 10 (balance heuristic,
//! paths from both ends).

use super::aim::Aim;
use super::hash;
use super::panes::{Panes, View};
use super::scatter::Scatter;
use crate::tracer::{Contact, Tracer};
use glam::{Vec2, Vec3};
use lunette_relight::light::Light;

/// What all paths share.
pub(crate) struct World<'a> {
    pub tracer: &'a Tracer<'a>,
    pub light: &'a Light,
    pub aims: &'a [Aim],
    pub bounces: u32,
}

/// Which sample of which stratified set a path is.
#[derive(Clone, Copy)]
pub(crate) struct Draw {
    /// Sample in the set, below `n`.
    pub index: u32,
    /// Size of the set.
    pub n: u32,
    /// Tells sets apart: a hash of seed, element and batch.
    pub set: u32,
}

impl Draw {
    /// Uniform in the unit square; each dimension is stratified over the set, and independent of the others.
    pub fn point(&self, dimension: u32) -> Vec2 {
        hash::stratified_2d(self.index, self.n, hash::mix([self.set, dimension]))
    }
}

/// What one path brings: straight from the light, and by way of other surfaces.
#[derive(Clone, Copy, Default)]
pub(crate) struct Gathered {
    pub direct: Vec3,
    pub indirect: Vec3,
}

/// A point of a path.
pub(crate) struct Place {
    /// Just above the surface.
    pub origin: Vec3,
    /// Unit, on the side of the path.
    pub n: Vec3,
    pub scatter: Scatter,
}

/// How a path came to a point: `r² / (p(x → y) cos_y)`, m² sr; 0 where nothing else could have found the point.
type Arrival = f32;

/// One estimate of what a point sends out.
pub(crate) fn gather(world: &World, first: Place, draw: Draw) -> Gathered {
    let mut gathered = Gathered::default();
    let (mut place, mut arrival, mut throughput) = (first, 0.0, Vec3::ONE);
    let mut dimension = 0..;
    for depth in 0..=world.bounces {
        let spot = Spot::new(world, &place, arrival);
        let mut u = || draw.point(dimension.next().unwrap_or(u32::MAX));
        let (lobe, on) = lobe_light(&spot, u(), depth < world.bounces);
        let straight = lobe + aimed_light(&spot, &mut u);
        if depth == 0 {
            gathered.direct = straight;
        } else {
            gathered.indirect += throughput * straight;
        }
        if depth < world.bounces {
            gathered.indirect += throughput * beamed_light(&spot, &mut u);
        }

        let Some(on) = on else { break };
        let way = on.contact.position.distance(place.origin);
        throughput *= on.weight * world.tracer.transmission(place.origin, on.direction, way);
        let next = world.tracer.place(&on.contact, on.contact.geometric_normal, on.direction);
        if throughput == Vec3::ZERO || next.scatter.is_black() {
            break;
        }
        let square = on.contact.position.distance_squared(place.origin);
        arrival = square / (on.density * -next.n.dot(on.direction)).max(f32::MIN_POSITIVE);
        place = next;
    }
    gathered
}

/// A point of a path, and what is known of the light there.
struct Spot<'a> {
    world: &'a World<'a>,
    place: &'a Place,
    arrival: Arrival,
    panes: Option<View<'a>>,
}

impl<'a> Spot<'a> {
    fn new(world: &'a World<'a>, place: &'a Place, arrival: Arrival) -> Spot<'a> {
        let panes = world.tracer.panes().map(|panes| panes.seen_from(place.origin, place.n));
        Spot { world, place, arrival, panes }
    }

    /// Of all techniques that draw directions here, 1/sr; `lobe` is the reflection's own.
    fn density(&self, d: Vec3, lobe: f32) -> f32 {
        lobe + aim_density(self.world, d) + self.panes.as_ref().map_or(0.0, |view| view.pdf(d))
    }

    /// `f L cos` over the densities, of a direction above the surface with nothing in its way and `radiance` from it.
    fn weighed(&self, d: Vec3, radiance: Vec3) -> Vec3 {
        if radiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let (reflected, lobe) = self.place.scatter.of(self.place.n, d);
        let cos = self.place.n.dot(d);
        let mut density = self.density(d, lobe);
        if self.arrival > 0.0 {
            density += self.arrival * cos * beam_density(self.world, self.place.origin, d);
        }
        let through = self.world.tracer.transmission(self.place.origin, d, f32::INFINITY);
        radiance * through * reflected * (cos / density)
    }

    fn is_blocked(&self, d: Vec3) -> bool {
        self.world.tracer.is_blocked(self.place.origin, d)
    }
}

fn aim_density(world: &World, d: Vec3) -> f32 {
    world.aims.iter().map(|aim| aim.pdf(d)).sum()
}

/// Of all beams through a point, per area across them, 1/(sr m²).
fn beam_density(world: &World, point: Vec3, d: Vec3) -> f32 {
    let aims: f32 = world.aims.iter().filter(|aim| aim.is_peaked()).map(|aim| aim.pdf(d)).sum();
    match world.tracer.panes() {
        Some(panes) if aims > 0.0 => aims * panes.beam(d).pdf(point),
        _ => 0.0,
    }
}

/// Light from the directions drawn from the aims, and to the openings.
fn aimed_light(spot: &Spot, u: &mut impl FnMut() -> Vec2) -> Vec3 {
    let world = spot.world;
    let mut sum = Vec3::ZERO;
    let mut add = |d: Vec3| {
        let is_above = spot.place.n.dot(d) > 0.0;
        let radiance = if is_above { world.light.radiance(d) } else { Vec3::ZERO };
        if radiance != Vec3::ZERO && !spot.is_blocked(d) {
            sum += spot.weighed(d, radiance);
        }
    };
    for aim in world.aims {
        add(aim.sample(u()));
    }
    if let Some(d) = spot.panes.as_ref().and_then(|view| view.sample(u())) {
        add(d);
    }
    sum
}

/// The next point of a path.
struct Onward {
    contact: Contact,
    direction: Vec3,
    /// Of the direction, 1/sr.
    density: f32,
    weight: Vec3,
}

/// Light from a direction drawn with the reflection's lobe, and what is in its way.
fn lobe_light(spot: &Spot, u: Vec2, goes_on: bool) -> (Vec3, Option<Onward>) {
    let Place { origin, n, scatter } = spot.place;
    let Some(drawn) = scatter.sample(*n, u) else { return (Vec3::ZERO, None) };
    let direction = drawn.direction;
    let light = || spot.weighed(direction, spot.world.light.radiance(direction));
    if !goes_on {
        let blocked = spot.is_blocked(direction);
        return (if blocked { Vec3::ZERO } else { light() }, None);
    }
    match spot.world.tracer.first_contact(*origin, direction) {
        None => (light(), None),
        Some(contact) => {
            let density = scatter.of(*n, direction).1;
            (Vec3::ZERO, Some(Onward { contact, direction, density, weight: drawn.weight }))
        }
    }
}

/// Light by way of points that beams through the openings light.
fn beamed_light(spot: &Spot, u: &mut impl FnMut() -> Vec2) -> Vec3 {
    let Some(panes) = spot.world.tracer.panes() else { return Vec3::ZERO };
    let mut sum = Vec3::ZERO;
    for aim in spot.world.aims.iter().filter(|aim| aim.is_peaked()) {
        let d = aim.sample(u());
        if let Some(entry) = panes.beam(d).sample(u()) {
            sum += joined(spot, panes, entry, d).unwrap_or(Vec3::ZERO);
        }
    }
    sum
}

/// Light from `d` through a point of a pane, by way of the surface behind it; `None` where it does not arrive.
fn joined(spot: &Spot, panes: &Panes, entry: Vec3, d: Vec3) -> Option<Vec3> {
    let (world, place) = (spot.world, spot.place);
    let radiance = world.light.radiance(d);
    if radiance == Vec3::ZERO {
        return None;
    }
    let contact = world.tracer.first_contact(entry, -d)?;
    let n_y = contact.geometric_normal;
    let to_y = contact.position - place.origin;
    let (square, way) = (to_y.length_squared(), to_y.try_normalize()?);
    let (cos_x, cos_y, cos_light) = (place.n.dot(way), -n_y.dot(way), n_y.dot(d));
    if cos_x <= 0.0 || cos_y <= 0.0 || cos_light <= 0.0 {
        return None;
    }
    let y = world.tracer.place(&contact, n_y, way);
    // At the edge of a pane the lifted point's ray may miss it: then it is left to the paths from x.
    let beams = beam_density(world, y.origin, d);
    let is_dark = y.scatter.is_black() || world.tracer.is_blocked(y.origin, d);
    if beams <= 0.0 || is_dark || !world.tracer.sees(place.origin, y.origin) {
        return None;
    }

    let (at_x, density_x) = place.scatter.of(place.n, way);
    let (at_y, lobe_y) = y.scatter.of(n_y, d);
    let from_y = Spot { world, place: &y, arrival: 0.0, panes: Some(panes.seen_from(y.origin, n_y)) };
    let path_density = density_x * cos_y / square * from_y.density(d, lobe_y);
    let density = cos_light * beams + path_density;
    let through = world.tracer.transmission(y.origin, d, f32::INFINITY)
        * world.tracer.transmission(place.origin, way, square.sqrt());
    Some(radiance * through * at_x * at_y * (cos_x * cos_y / square * cos_light / density))
}
