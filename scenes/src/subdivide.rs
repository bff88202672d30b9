//! Subdivision, to a longest edge or of chosen edges.
//!
//! In each pass every edge that is too long, or chosen, gets a vertex in its middle, and every triangle is cut along the
//! middles of its edges into two, three or four. Whether and where an edge is cut depends only on the positions of its
//! two ends, so triangles on both sides agree, also where their vertices are split by a crease, and no T-junctions or
//! cracks appear.
//!
//! Each pass halves what is too long, so it takes about log2(longest edge / limit) passes.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use crate::normals::face_normal;
use crate::scene::{Error, Mesh, Scene};

/// Most triangles that subdivision makes: 200 million take some 7 GB as a mesh, before any baking.
pub const MAX_TRIANGLES: u64 = 200_000_000;

/// Cuts triangles until no edge is longer than `longest_edge`, metres. Materials and groups are kept, normals are
/// interpolated, and the vertices that were there come first, in their order.
///
/// # Errors
/// [`Error::Invalid`] if `longest_edge` is not a positive number, if it would take more than [`MAX_TRIANGLES`], or
/// if f32 has no room between the ends of an edge. The scene is not changed then.
pub fn subdivide(scene: &mut Scene, longest_edge: f32) -> Result<(), Error> {
    if !(longest_edge > 0.0 && longest_edge.is_finite()) {
        return Err(invalid(format!(
            "the longest edge has to be a positive number of metres, not {longest_edge}"
        )));
    }
    let at_least = least_triangles(&scene.mesh, longest_edge);
    if at_least > MAX_TRIANGLES as f64 {
        return Err(too_many(at_least, longest_edge));
    }
    if scene.mesh.index.iter().all(|&t| long_edges(&scene.mesh, t, longest_edge) == [false; 3]) {
        return Ok(());
    }
    let mut mesh = scene.mesh.clone();
    loop {
        let long: Vec<[bool; 3]> = mesh.index.iter().map(|&t| long_edges(&mesh, t, longest_edge)).collect();
        if !pass(&mut mesh, &long, |n| too_many(n, longest_edge))? {
            break;
        }
    }
    scene.mesh = mesh;
    Ok(())
}

/// Cuts each edge once of which `is_chosen` says so of the vertices at its ends, given in either order; where several edges lie
/// between the same two places, of any of them. As [`subdivide`] otherwise. Says how many triangles more there are.
///
/// # Errors
/// [`Error::Invalid`] if it would take more than [`MAX_TRIANGLES`], or if f32 has no room between the ends of an edge. The
/// scene is not changed then.
pub fn cut_edges(scene: &mut Scene, is_chosen: impl Fn(&Mesh, u32, u32) -> bool) -> Result<usize, Error> {
    let mesh = &scene.mesh;
    let place = |v: u32| mesh.position[v as usize].to_array().map(f32::to_bits);
    let between = |[a, b]: [u32; 2]| {
        let [a, b] = [place(a), place(b)];
        if a < b { [a, b] } else { [b, a] }
    };
    let edges = |t: [u32; 3]| [0, 1, 2].map(|k| [t[k], t[(k + 1) % 3]]);
    let chosen = mesh.index.iter().flat_map(|&t| edges(t)).filter(|[a, b]| is_chosen(mesh, *a, *b));
    let chosen: HashSet<_> = chosen.map(between).collect();
    if chosen.is_empty() {
        return Ok(0);
    }
    let cuts: Vec<[bool; 3]> =
        mesh.index.iter().map(|&t| edges(t).map(|edge| chosen.contains(&between(edge)))).collect();
    let (mut mesh, before) = (scene.mesh.clone(), scene.mesh.index.len());
    let too_many =
        |n| invalid(format!("it takes {n:.1e} triangles, and {:.0e} is the limit", MAX_TRIANGLES as f64));
    pass(&mut mesh, &cuts, too_many)?;
    scene.mesh = mesh;
    Ok(scene.mesh.index.len() - before)
}

fn invalid(what: String) -> Error {
    Error::Invalid { at: "subdivide".into(), what }
}

fn too_many(n: f64, longest_edge: f32) -> Error {
    invalid(format!(
        "edges of at most {longest_edge} m take over {n:.1e} triangles, and {:.0e} is the limit; allow longer edges",
        MAX_TRIANGLES as f64
    ))
}

/// A lower bound of the triangles that it takes: an equilateral triangle has the largest area for its longest edge,
/// sqrt(3)/4 of the square; and a long edge has to be cut into as many parts as the limit goes into it.
fn least_triangles(mesh: &Mesh, longest_edge: f32) -> f64 {
    let limit = f64::from(longest_edge);
    let largest = 3.0_f64.sqrt() / 4.0 * limit * limit;
    let one = |t: &[u32; 3]| {
        let p = t.map(|v| mesh.position[v as usize].as_dvec3());
        let area = (p[1] - p[0]).cross(p[2] - p[0]).length() / 2.0;
        let edge = (0..3).map(|k| p[k].distance(p[(k + 1) % 3])).fold(0.0, f64::max);
        (area / largest).max(edge / limit).max(1.0)
    };
    mesh.index.iter().map(one).sum()
}

/// Whether each edge, from corner k to k + 1, is too long. The same from both ends.
fn long_edges(mesh: &Mesh, triangle: [u32; 3], limit: f32) -> [bool; 3] {
    let p = triangle.map(|v| mesh.position[v as usize]);
    [0, 1, 2].map(|k| p[k].distance(p[(k + 1) % 3]) > limit)
}

/// Cuts these edges of all triangles once; false if there are none.
fn pass(mesh: &mut Mesh, cuts: &[[bool; 3]], too_many: impl Fn(f64) -> Error) -> Result<bool, Error> {
    let n_cuts: usize = cuts.iter().flatten().filter(|&&is_cut| is_cut).count();
    if n_cuts == 0 {
        return Ok(false);
    }
    let n = mesh.index.len() + n_cuts;
    if n as u64 > MAX_TRIANGLES {
        return Err(too_many(n as f64));
    }

    let mut middles = Middles::default();
    let old = std::mem::replace(&mut mesh.index, Vec::with_capacity(n));
    let (material, group) = (std::mem::take(&mut mesh.material), std::mem::take(&mut mesh.group));
    for (i, triangle) in old.into_iter().enumerate() {
        cut(mesh, triangle, cuts[i], &mut middles)?;
        mesh.material.resize(mesh.index.len(), material[i]);
        mesh.group.resize(mesh.index.len(), group[i]);
    }
    Ok(true)
}

/// The vertex in the middle of each edge cut in this pass, by the smaller and the larger index of its ends.
#[derive(Default)]
struct Middles(HashMap<(u32, u32), u32>);

impl Middles {
    fn between(&mut self, mesh: &mut Mesh, a: u32, b: u32, face: Vec3) -> Result<u32, Error> {
        let key = (a.min(b), a.max(b));
        if let Some(&middle) = self.0.get(&key) {
            return Ok(middle);
        }
        let (p, q) = (mesh.position[a as usize], mesh.position[b as usize]);
        let middle = 0.5 * p + 0.5 * q;
        if middle == p || middle == q {
            return Err(invalid(format!(
                "32-bit numbers have no room between {p} and {q}; allow longer edges"
            )));
        }
        let normal = mesh.normal[a as usize] + mesh.normal[b as usize];
        mesh.position.push(middle);
        mesh.normal.push(normal.try_normalize().unwrap_or(face));
        let index = mesh.position.len() as u32 - 1;
        self.0.insert(key, index);
        Ok(index)
    }
}

/// Cuts one triangle at the middles of its long edges. The pieces keep its winding, and its first corner leads.
fn cut(mesh: &mut Mesh, triangle: [u32; 3], long: [bool; 3], middles: &mut Middles) -> Result<(), Error> {
    // Turned so that the case at hand is one of four: none; the first edge; the first two; all.
    let turn = match long {
        [true, false, true] => 2,
        [false, true, _] => 1,
        [false, false, true] => 2,
        _ => 0,
    };
    let [a, b, c] = [0, 1, 2].map(|k| triangle[(k + turn) % 3]);
    let n_long = long.iter().filter(|&&is_long| is_long).count();
    let face = face_normal([a, b, c].map(|v| mesh.position[v as usize]));
    let mut middle = |mesh: &mut Mesh, p, q| middles.between(mesh, p, q, face);
    match n_long {
        0 => mesh.index.push([a, b, c]),
        1 => {
            let ab = middle(mesh, a, b)?;
            mesh.index.extend([[a, ab, c], [ab, b, c]]);
        }
        2 => {
            let (ab, bc) = (middle(mesh, a, b)?, middle(mesh, b, c)?);
            mesh.index.push([ab, b, bc]);
            mesh.index.extend(cut_quad(mesh, [a, ab, bc, c]));
        }
        _ => {
            let (ab, bc, ca) = (middle(mesh, a, b)?, middle(mesh, b, c)?, middle(mesh, c, a)?);
            mesh.index.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
    }
    Ok(())
}

/// Two triangles along the shorter diagonal.
fn cut_quad(mesh: &Mesh, [a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    let distance = |p: u32, q: u32| mesh.position[p as usize].distance_squared(mesh.position[q as usize]);
    if distance(a, c) <= distance(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}
