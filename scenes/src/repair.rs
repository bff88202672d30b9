//! From whatever triangles a file holds to a [`Mesh`] that keeps its promises.
//!
//! In order: turn and scale; leave out triangles without area and those in the place of another; make normals unit,
//! and let them decide the winding; build what normals are missing or impossible; split vertices where normal or
//! material changes, join those that are the same. Each kind of mending adds a line to the report.
//!
//! Vertices keep the order of the file: of several copies the first stays in its place, those that a split adds
//! come last.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{DVec3, Vec3};

use crate::names::count;
use crate::normals;
use crate::open::{LoadOptions, Up};
use crate::scene::{Error, Mesh, Scene};

/// Farthest that a vertex may lie from the origin along an axis, metres: fifteen times the radius of the Earth.
/// Beyond 1e9, squares of cross products of edges leave the range of f32.
const MAX_COORDINATE: f32 = 1e8;

/// A triangle whose height is a smaller share of its longest edge than this has no area: its corners are collinear
/// as far as f32 can tell.
const FLAT: f64 = 1e-7;

/// Twice the area, m², under which a triangle has none: its square would leave the range of normal f32.
const TINY: f64 = 1e-17;

/// Normals of a squared length this close to 1 are taken as they are: what normalising in f32 leaves.
const UNIT: f32 = 5e-7;

/// Normals of a squared length this far from 1 are worth a line in the report; less is rounding in a text file.
const NOT_UNIT: f32 = 1e-2;

/// Triangles as a file gives them.
#[derive(Default)]
pub(crate) struct Soup {
    /// In file units, all vertices of the file, finite.
    pub position: Vec<Vec3>,
    /// Indices into `position`, in range.
    pub triangle: Vec<[u32; 3]>,
    /// Normal at each corner of each triangle, any length; zero where the file has none.
    pub normal: Vec<[Vec3; 3]>,
    /// Index into the materials of the scene, per triangle.
    pub material: Vec<u32>,
    /// Index into the groups of the scene, per triangle.
    pub group: Vec<u32>,
}

/// Mends `soup` into the mesh of `scene`, which has its materials and groups already.
///
/// # Errors
/// [`Error::Invalid`] at `at` if a vertex is too far away or no triangle is left.
pub(crate) fn finish(
    mut soup: Soup,
    mut scene: Scene,
    options: &LoadOptions,
    at: &str,
) -> Result<Scene, Error> {
    let invalid = |what: String| Error::Invalid { at: at.to_owned(), what };
    place(&mut soup, options).map_err(invalid)?;
    let same = same_place(&soup.position);
    drop_triangles(&mut soup, &same, &mut scene.report);
    if soup.triangle.is_empty() {
        return Err(invalid("no triangle in it has an area".into()));
    }
    if soup.triangle.len() > u32::MAX as usize / 3 {
        return Err(invalid(format!("{} triangles are more than 32-bit indices reach", soup.triangle.len())));
    }
    mend_normals(&mut soup, options, &mut scene.report);
    normals::fill(&mut soup, &same, options.crease_angle, &mut scene.report);
    scene.mesh = join(&soup, &same, &mut scene.report);
    keep_used_groups(&mut scene);
    Ok(scene)
}

/// Normal of a triangle times twice its area, from exact differences.
pub(crate) fn cross([a, b, c]: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

fn place(soup: &mut Soup, options: &LoadOptions) -> Result<(), String> {
    for (i, p) in soup.position.iter_mut().enumerate() {
        *p = options.up.to_y(*p) * options.scale;
        let away = p.abs().max_element();
        if away > MAX_COORDINATE {
            return Err(format!(
                "vertex {} lies {away:e} m from the origin, and {MAX_COORDINATE:e} m is the farthest; check --scale",
                i + 1
            ));
        }
    }
    if options.up != Up::Y {
        soup.normal.iter_mut().flatten().for_each(|n| *n = options.up.to_y(*n));
    }
    Ok(())
}

/// For each position the first one in exactly the same place.
fn same_place(position: &[Vec3]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(position.len());
    let number = |(i, p): (usize, &Vec3)| *first.entry(bits(*p)).or_insert(i as u32);
    position.iter().enumerate().map(number).collect()
}

/// Equal for equal vectors; -0 counts as 0.
pub(crate) fn bits(v: Vec3) -> [u32; 3] {
    (v + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Leaves out triangles without area and all but the first of those with the same three corners.
fn drop_triangles(soup: &mut Soup, same: &[u32], report: &mut Vec<String>) {
    let (mut n_flat, mut n_doubled, mut n_backs) = (0, 0, 0);
    let mut seen = HashMap::with_capacity(soup.triangle.len());
    let keep = |triangle: &[u32; 3]| {
        if is_flat(triangle.map(|v| soup.position[v as usize])) {
            n_flat += 1;
            return false;
        }
        let turned = smallest_first(triangle.map(|v| same[v as usize]));
        let mut sorted = turned;
        sorted.sort_unstable();
        match seen.entry(sorted) {
            Entry::Vacant(entry) => {
                entry.insert(turned);
                return true;
            }
            Entry::Occupied(first) if *first.get() == turned => n_doubled += 1,
            Entry::Occupied(_) => n_backs += 1,
        }
        false
    };
    let kept: Vec<bool> = soup.triangle.iter().map(keep).collect();
    if kept.contains(&false) {
        retain(&mut soup.triangle, &kept);
        retain(&mut soup.normal, &kept);
        retain(&mut soup.material, &kept);
        retain(&mut soup.group, &kept);
    }
    tell(report, n_flat, "zero-area triangle", "left out");
    tell(report, n_doubled, "triangle", "in the place of another left out");
    tell(report, n_backs, "triangle", "in the place of another that faces the other way left out");
}

pub(crate) fn is_flat(corner: [Vec3; 3]) -> bool {
    let [a, b, c] = corner.map(Vec3::as_dvec3);
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    let area = cross(corner).length();
    area <= FLAT * longest || area < TINY
}

/// The triangle turned so that its smallest index leads: equal for equal triangles of the same winding.
fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

fn retain<T>(list: &mut Vec<T>, kept: &[bool]) {
    let mut keep = kept.iter();
    list.retain(|_| *keep.next().expect("as many flags as items"));
}

/// Makes normals unit, turns triangles to the side that theirs point to, and zeroes those that are none or lie on
/// the wrong side of their triangle.
fn mend_normals(soup: &mut Soup, options: &LoadOptions, report: &mut Vec<String>) {
    let any = soup.normal.iter().flatten().any(|&n| n != Vec3::ZERO);
    if !any {
        let angle = options.crease_angle.to_degrees();
        report.push(format!("no normals: built from the faces, with creases over {angle:.0} degrees"));
        return;
    }
    let (mut n_scaled, mut n_missing, mut n_flipped, mut n_behind) = (0, 0, 0, 0);
    for (triangle, normals) in soup.triangle.iter_mut().zip(&mut soup.normal) {
        for n in normals.iter_mut() {
            n_scaled += usize::from((n.length_squared() - 1.0).abs() > NOT_UNIT && is_direction(*n));
            *n = unit(*n);
            n_missing += usize::from(*n == Vec3::ZERO);
        }
        let face = cross(triangle.map(|v| soup.position[v as usize]));
        let mut side = normals.map(|n| n.as_dvec3().dot(face));
        if side.iter().all(|&s| s < 0.0) {
            triangle.swap(1, 2);
            normals.swap(1, 2);
            side = side.map(|s| -s);
            n_flipped += 1;
        }
        for (n, side) in normals.iter_mut().zip(side) {
            if side <= 0.0 && *n != Vec3::ZERO {
                *n = Vec3::ZERO;
                n_behind += 1;
            }
        }
    }
    tell(report, n_scaled, "corner normal", "of another length made unit");
    tell(report, n_missing, "corner normal", "missing, zero or not a number built from the faces");
    tell(report, n_flipped, "triangle", "wound against the normals turned over");
    tell(report, n_behind, "corner normal", "pointing behind the face built from the faces");
}

fn is_direction(n: Vec3) -> bool {
    n.is_finite() && n != Vec3::ZERO
}

/// Unit length, or zero for what is no direction.
fn unit(n: Vec3) -> Vec3 {
    if (n.length_squared() - 1.0).abs() <= UNIT {
        return n;
    }
    // In f64, where the square of no f32 overflows or vanishes.
    let long = n.as_dvec3();
    if is_direction(n) { long.normalize().as_vec3() } else { Vec3::ZERO }
}

/// Makes one vertex of all corners with the same place, normal and material.
fn join(soup: &Soup, same: &[u32], report: &mut Vec<String>) -> Mesh {
    let key = number_keys(soup, same);
    let order = order_vertices(soup, &key);

    let mut mesh = Mesh {
        position: vec![Vec3::ZERO; order.n],
        normal: vec![Vec3::ZERO; order.n],
        index: Vec::with_capacity(soup.triangle.len()),
        material: soup.material.clone(),
        group: soup.group.clone(),
    };
    for ((triangle, normals), key) in soup.triangle.iter().zip(&soup.normal).zip(key.chunks_exact(3)) {
        let index: [u32; 3] = std::array::from_fn(|k| order.vertex_of_key[key[k] as usize]);
        for k in 0..3 {
            mesh.position[index[k] as usize] = soup.position[triangle[k] as usize];
            mesh.normal[index[k] as usize] = normals[k];
        }
        mesh.index.push(index);
    }
    tell(report, order.n_unused, "unused vertex", "left out");
    tell(report, order.n_joined, "duplicate vertex", "joined");
    mesh
}

/// A number for each corner, the same for corners that share place, normal and material.
fn number_keys(soup: &Soup, same: &[u32]) -> Vec<u32> {
    let mut number = HashMap::with_capacity(soup.position.len());
    let mut key = Vec::with_capacity(3 * soup.triangle.len());
    for ((triangle, normals), &material) in soup.triangle.iter().zip(&soup.normal).zip(&soup.material) {
        for (&v, &normal) in triangle.iter().zip(normals) {
            let next = number.len() as u32;
            key.push(*number.entry((same[v as usize], bits(normal), material)).or_insert(next));
        }
    }
    key
}

struct Order {
    vertex_of_key: Vec<u32>,
    n: usize,
    n_unused: usize,
    n_joined: usize,
}

/// Gives each vertex of the file to the first of its keys that has none yet, in file order, then the rest new ones.
fn order_vertices(soup: &Soup, key: &[u32]) -> Order {
    const NONE: u32 = u32::MAX;
    let corners = Fans::new(soup.position.len(), soup.triangle.as_flattened().iter().copied());
    let n_keys = key.iter().max().map_or(0, |&k| k as usize + 1);
    let mut order = Order { vertex_of_key: vec![NONE; n_keys], n: 0, n_unused: 0, n_joined: 0 };
    for v in 0..soup.position.len() {
        let fan = corners.of(v);
        let free = fan.iter().map(|&c| key[c as usize] as usize).find(|&k| order.vertex_of_key[k] == NONE);
        match free {
            Some(k) => {
                order.vertex_of_key[k] = order.n as u32;
                order.n += 1;
            }
            None if fan.is_empty() => order.n_unused += 1,
            None => order.n_joined += 1,
        }
    }
    for &k in key {
        let vertex = &mut order.vertex_of_key[k as usize];
        if *vertex == NONE {
            *vertex = order.n as u32;
            order.n += 1;
        }
    }
    order
}

/// For each of `n` things, the corners that name it, in order.
pub(crate) struct Fans {
    start: Vec<u32>,
    corner: Vec<u32>,
}

impl Fans {
    /// Sorts corners 0, 1, 2, ... by what they name.
    pub fn new(n: usize, named: impl Iterator<Item = u32> + Clone) -> Fans {
        let mut start = vec![0_u32; n + 2];
        for v in named.clone() {
            start[v as usize + 2] += 1;
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut corner = vec![0; start[n + 1] as usize];
        for (c, v) in named.enumerate() {
            let place = &mut start[v as usize + 1];
            corner[*place as usize] = c as u32;
            *place += 1;
        }
        Fans { start, corner }
    }

    pub fn of(&self, v: usize) -> &[u32] {
        &self.corner[self.start[v] as usize..self.start[v + 1] as usize]
    }
}

fn keep_used_groups(scene: &mut Scene) {
    let mut used = vec![false; scene.groups.len()];
    scene.mesh.group.iter().for_each(|&g| used[g as usize] = true);
    let count_before = |n: &mut u32, &is_used: &bool| {
        *n += u32::from(is_used);
        Some(*n - u32::from(is_used))
    };
    let new: Vec<u32> = used.iter().scan(0, count_before).collect();
    scene.mesh.group.iter_mut().for_each(|g| *g = new[*g as usize]);
    retain(&mut scene.groups, &used);
}

fn tell(report: &mut Vec<String>, n: usize, thing: &str, what: &str) {
    if n > 0 {
        report.push(format!("{} {what}", count(n, thing)));
    }
}
