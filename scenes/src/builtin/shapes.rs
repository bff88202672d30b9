//! Round things and panes, as patches: lofts, lathes, spheres, discs, arches and round holes in walls.
//!
//! Lengths in metres; `edge` is the longest edge wanted. Shapes that fill a `Hidden` place of a
//! [`Solid`](super::solid::Solid) take its grid lines, and so meet its skin vertex by vertex.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use super::draft::{Draft, Facing, Grid, Paint};

/// How many pieces no longer than `edge` a length makes.
pub fn pieces(length: f32, edge: f32) -> usize {
    // A hair less, or rounding would make two pieces of one exact edge.
    (length / edge - 1e-4).ceil().max(1.0) as usize
}

/// `n + 1` evenly spaced numbers from one to another.
pub fn spread(lo: f32, hi: f32, n: usize) -> Vec<f32> {
    (0..=n).map(|i| if i == n { hi } else { lo + (hi - lo) * i as f32 / n as f32 }).collect()
}

/// The points `place(u, v)`: a row for each v.
pub fn grid(u: &[f32], v: &[f32], place: impl Fn(f32, f32) -> Vec3) -> Grid {
    let point = v.iter().flat_map(|&b| u.iter().map(move |&a| (a, b))).map(|(a, b)| place(a, b)).collect();
    Grid { columns: u.len(), point }
}

/// A level rectangle seen from above.
pub fn floor(draft: &mut Draft, paint: Paint, x: &[f32], y: f32, z: &[f32]) {
    draft.patch(paint, &grid(x, z, |x, z| vec3(x, y, z)), Facing::Along(Vec3::Y));
}

/// Straight lines from each point of one polyline to the same of the other, in pieces of `edge`.
pub fn loft(from: &[Vec3], to: &[Vec3], edge: f32) -> Grid {
    let longest = from.iter().zip(to).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    let n = pieces(longest, edge);
    let row = |i: usize| from.iter().zip(to).map(move |(a, b)| a.lerp(*b, i as f32 / n as f32));
    Grid { columns: from.len(), point: (0..=n).flat_map(row).collect() }
}

/// `n` equal angles once round, radians; the last is the first again, so that the seam closes exactly.
pub fn round(n: usize) -> Vec<f32> {
    (0..=n).map(|i| TAU * (i % n) as f32 / n as f32).collect()
}

/// Points of a level circle at the given angles, measured from +x to +z.
pub fn circle(centre: Vec3, radius: f32, angles: &[f32]) -> Vec<Vec3> {
    angles.iter().map(|a| centre + radius * vec3(a.cos(), 0.0, a.sin())).collect()
}

/// A surface of revolution about the vertical through `foot`, seen from outside: the profile's points are
/// radius and height above the foot, and its steps are not divided further.
pub fn lathe(draft: &mut Draft, paint: Paint, foot: Vec3, profile: &[Vec2], angles: &[f32]) {
    let point = profile.iter().flat_map(|p| circle(foot + p.y * Vec3::Y, p.x, angles)).collect();
    let middle = 0.5 * (profile[0].y + profile[profile.len() - 1].y);
    draft.patch(paint, &Grid { columns: angles.len(), point }, Facing::From(foot + middle * Vec3::Y));
}

/// A profile in steps of at most `edge` along a straight line.
pub fn slope(from: Vec2, to: Vec2, edge: f32) -> Vec<Vec2> {
    let n = pieces(from.distance(to), edge);
    spread(0.0, 1.0, n).iter().map(|&t| from.lerp(to, t)).collect()
}

/// A level disc, or with an inner radius a ring.
pub fn disc(
    draft: &mut Draft,
    paint: Paint,
    centre: Vec3,
    radii: [f32; 2],
    angles: &[f32],
    edge: f32,
    up: Vec3,
) {
    let [inner, outer] = radii.map(|r| circle(centre, r, angles));
    draft.patch(paint, &loft(&inner, &outer, edge), Facing::Along(up));
}

/// A sphere of parallels and meridians, with exact normals.
pub fn sphere(draft: &mut Draft, paint: Paint, centre: Vec3, radius: f32, edge: f32) {
    let meridians = pieces(TAU * radius, edge).max(8);
    let latitudes = spread(-PI / 2.0, PI / 2.0, (meridians / 2).max(4));
    let points = grid(&round(meridians), &latitudes, |a, b| {
        centre + radius * vec3(b.cos() * a.cos(), b.sin(), b.cos() * a.sin())
    });
    draft.smooth_patch(paint, &points, |p| (p - centre).normalize());
}

/// A wall's own coordinates: along it, up, and through it; and the place in the scene of such a point.
pub struct Wall<'a> {
    /// Grid lines along the wall over the opening.
    pub along: Vec<f32>,
    /// Grid lines upwards over the opening.
    pub up: Vec<f32>,
    /// Grid lines through the wall.
    pub through: Vec<f32>,
    /// From (along, up, through) to the scene.
    pub place: &'a dyn Fn(f32, f32, f32) -> Vec3,
}

impl Wall<'_> {
    fn middle(&self) -> f32 {
        0.5 * (self.along[0] + self.along[self.along.len() - 1])
    }

    fn ends(&self) -> [f32; 2] {
        [self.through[0], self.through[self.through.len() - 1]]
    }

    /// Direction in the scene of going through the wall, or back.
    fn outward(&self, d: f32) -> Vec3 {
        let [near, far] = self.ends();
        let (u, v) = (self.middle(), self.up[0]);
        ((self.place)(u, v, d) - (self.place)(u, v, 0.5 * (near + far))).normalize_or(Vec3::Y)
    }

    fn points(&self, outline: &[Vec2], d: f32) -> Vec<Vec3> {
        outline.iter().map(|p| (self.place)(p.x, p.y, d)).collect()
    }

    /// Up the near side of the rectangle, along its top and down the far side.
    fn portal_outline(&self) -> Vec<Vec2> {
        let (left, right) = (self.along[0], self.along[self.along.len() - 1]);
        let top = self.up[self.up.len() - 1];
        let rise = self.up.iter().map(|&v| vec2(left, v));
        let run = self.along.iter().skip(1).map(|&u| vec2(u, top));
        let fall = self.up.iter().rev().skip(1).map(|&v| vec2(right, v));
        rise.chain(run).chain(fall).collect()
    }

    /// Once round the rectangle; the last point is the first again.
    fn frame_outline(&self) -> Vec<Vec2> {
        let bottom = self.up[0];
        let back = self.along.iter().rev().skip(1).map(|&u| vec2(u, bottom));
        self.portal_outline().into_iter().chain(back).collect()
    }
}

/// The points of a circle in the same directions as those of an outline.
fn projected(outline: &[Vec2], centre: Vec2, radius: f32) -> Vec<Vec2> {
    outline.iter().map(|p| centre + radius * (*p - centre).normalize_or(Vec2::Y)).collect()
}

/// A round arch over an opening: the wall between the rectangle and the arc on both sides, and the underside.
/// The rectangle is as wide as the arc and springs where the arc does; what is above the arc is wall.
pub fn arch(draft: &mut Draft, paint: Paint, wall: &Wall, edge: f32) {
    let outline = wall.portal_outline();
    let centre = vec2(wall.middle(), wall.up[0]);
    let arc = projected(&outline, centre, centre.x - wall.along[0]);
    pierced(draft, paint, wall, [&outline, &arc], edge);
}

/// A barrel vault: the underside alone of an [`arch`], from one end to the other.
pub fn vault(draft: &mut Draft, paint: Paint, wall: &Wall) {
    let centre = vec2(wall.middle(), wall.up[0]);
    reveal(draft, paint, wall, &projected(&wall.portal_outline(), centre, centre.x - wall.along[0]));
}

/// A round hole of the given radius in the middle of a rectangle of wall.
pub fn round_hole(draft: &mut Draft, paint: Paint, wall: &Wall, radius: f32, edge: f32) {
    let outline = wall.frame_outline();
    let rim = projected(&outline, frame_centre(wall), radius);
    pierced(draft, paint, wall, [&outline, &rim], edge);
}

/// A pane for [`round_hole`], at depth `d`, seen from `facing`.
pub fn round_pane(
    draft: &mut Draft,
    paint: Paint,
    wall: &Wall,
    radius: f32,
    d: f32,
    edge: f32,
    facing: Vec3,
) {
    let centre = frame_centre(wall);
    let rim = wall.points(&projected(&wall.frame_outline(), centre, radius), d);
    let hub = vec![(wall.place)(centre.x, centre.y, d); rim.len()];
    draft.patch(paint, &loft(&hub, &rim, edge), Facing::Along(facing));
}

/// The half disc under an [`arch`], at depth `d`, seen from `facing`: a pane or the end wall of a vault.
pub fn half_disc(draft: &mut Draft, paint: Paint, wall: &Wall, d: f32, edge: f32, facing: Vec3) {
    let centre = vec2(wall.middle(), wall.up[0]);
    let arc = projected(&wall.portal_outline(), centre, centre.x - wall.along[0]);
    let chord: Vec<Vec2> = arc.iter().map(|p| vec2(p.x, centre.y)).collect();
    draft.patch(paint, &loft(&wall.points(&chord, d), &wall.points(&arc, d), edge), Facing::Along(facing));
}

fn frame_centre(wall: &Wall) -> Vec2 {
    vec2(wall.middle(), 0.5 * (wall.up[0] + wall.up[wall.up.len() - 1]))
}

/// Both faces of a wall between an outline and a round rim in it, and the rim's reveal.
fn pierced(draft: &mut Draft, paint: Paint, wall: &Wall, [outline, rim]: [&[Vec2]; 2], edge: f32) {
    for d in wall.ends() {
        let face = loft(&wall.points(outline, d), &wall.points(rim, d), edge);
        draft.patch(paint, &face, Facing::Along(wall.outward(d)));
    }
    reveal(draft, paint, wall, rim);
}

/// The inside of a round opening, from one face of the wall to the other.
fn reveal(draft: &mut Draft, paint: Paint, wall: &Wall, rim: &[Vec2]) {
    let point = wall.through.iter().flat_map(|&d| wall.points(rim, d)).collect();
    let axis = rim.iter().sum::<Vec2>() / rim.len() as f32;
    let [near, far] = wall.ends();
    let inside = (wall.place)(axis.x, axis.y, 0.5 * (near + far));
    draft.patch(paint, &Grid { columns: rim.len(), point }, Facing::Towards(inside));
}

/// A round column between two square slabs, and the slabs' faces around it. `x` and `z` are the grid lines over
/// the square, `y` bottom and top, `radius` the shaft's at its foot. With base, entasis (the shaft tapers by an
/// eighth, along a quarter of a cosine) and a spreading capital.
pub fn column(draft: &mut Draft, paint: Paint, [x, z]: [&[f32]; 2], y: [f32; 2], radius: f32, edge: f32) {
    let height = y[1] - y[0];
    // Base and capital spread by 15 % of the radius, over as much height as the radius has.
    let (spread_radius, slice) = (1.15 * radius, radius.min(0.15 * height));
    let (foot, angles) = around(draft, paint, [x, z], y[0], spread_radius, edge, Vec3::Y);
    around(draft, paint, [x, z], y[1], spread_radius, edge, -Vec3::Y);
    let taper = |t: f32| radius * (1.0 - 0.125 * (1.0 - (0.5 * PI * t).cos()));
    let (low, high) = (0.5 * slice, height - slice);
    let shaft: Vec<Vec2> = spread(0.0, 1.0, pieces(high - low, edge))
        .iter()
        .map(|&t| vec2(taper(t), low + t * (high - low)))
        .collect();
    lathe(draft, paint, foot, &[vec2(spread_radius, 0.0), vec2(spread_radius, 0.5 * low)], &angles);
    lathe(draft, paint, foot, &[vec2(spread_radius, 0.5 * low), vec2(radius, low)], &angles);
    lathe(draft, paint, foot, &shaft, &angles);
    lathe(draft, paint, foot, &slope(vec2(taper(1.0), high), vec2(spread_radius, height), edge), &angles);
}

/// The level square of grid lines `x` and `z` at height `y`, but for the disc in its middle on which something
/// round stands. Gives the disc's centre and the angles of its rim, for what stands there.
pub fn around(
    draft: &mut Draft,
    paint: Paint,
    [x, z]: [&[f32]; 2],
    y: f32,
    radius: f32,
    edge: f32,
    up: Vec3,
) -> (Vec3, Vec<f32>) {
    let square = perimeter(x, z);
    let centre = vec3(0.5 * (x[0] + x[x.len() - 1]), y, 0.5 * (z[0] + z[z.len() - 1]));
    let angles: Vec<f32> = square.iter().map(|p| (p.y - centre.z).atan2(p.x - centre.x)).collect();
    let corners: Vec<Vec3> = square.iter().map(|p| vec3(p.x, y, p.y)).collect();
    draft.patch(paint, &loft(&corners, &circle(centre, radius, &angles), edge), Facing::Along(up));
    (centre, angles)
}

/// Once round a rectangle of grid lines in x and z; the last point is the first again.
pub fn perimeter(x: &[f32], z: &[f32]) -> Vec<Vec2> {
    let (x0, x1, z0, z1) = (x[0], x[x.len() - 1], z[0], z[z.len() - 1]);
    let there = x.iter().map(|&x| vec2(x, z0)).chain(z.iter().skip(1).map(|&z| vec2(x1, z)));
    let back =
        x.iter().rev().skip(1).map(|&x| vec2(x, z1)).chain(z.iter().rev().skip(1).map(|&z| vec2(x0, z)));
    there.chain(back).collect()
}
