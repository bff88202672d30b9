//! What must hold of the tensors before anyone indexes with them.

use safetensors::Dtype;

use super::{Asset, Data, Error, Tensor};
use crate::block::LANES;
use crate::sh::MAX_COEFFICIENTS;
use crate::sparse::Rows;

/// Type and shape that a known tensor must have. `*` in a name stands for a number.
struct Rule {
    name: &'static str,
    dtype: Dtype,
    shape: Shape,
}

/// V vertices, T triangles, n² a square up to 100; any two lengths are at least 1.
enum Shape {
    Vertex,
    VertexTriple,
    TriangleTriple,
    VertexSquare,
    VertexSquareTriple,
    Any,
    AnyPair,
    /// Any length, of blocks.
    Block,
}

const RULES: &[Rule] = &[
    Rule { name: "mesh.position", dtype: Dtype::F32, shape: Shape::VertexTriple },
    Rule { name: "mesh.normal", dtype: Dtype::F32, shape: Shape::VertexTriple },
    Rule { name: "mesh.albedo", dtype: Dtype::F32, shape: Shape::VertexTriple },
    Rule { name: "mesh.index", dtype: Dtype::U32, shape: Shape::TriangleTriple },
    Rule { name: "sky.ao", dtype: Dtype::F16, shape: Shape::Vertex },
    Rule { name: "sky.bent", dtype: Dtype::F16, shape: Shape::VertexTriple },
    Rule { name: "sky.aperture", dtype: Dtype::F16, shape: Shape::Vertex },
    Rule { name: "sky.direct.sh", dtype: Dtype::F16, shape: Shape::VertexSquare },
    Rule { name: "sky.indirect.sh", dtype: Dtype::F16, shape: Shape::VertexSquareTriple },
    Rule { name: "portal.*.indirect.sh", dtype: Dtype::F16, shape: Shape::VertexSquareTriple },
    Rule { name: "indirect.patch", dtype: Dtype::U16, shape: Shape::Vertex },
    Rule { name: "indirect.tree", dtype: Dtype::U16, shape: Shape::AnyPair },
    Rule { name: "indirect.part", dtype: Dtype::F32, shape: Shape::Any },
    Rule { name: "indirect.row", dtype: Dtype::U16, shape: Shape::Block },
    Rule { name: "indirect.start", dtype: Dtype::U32, shape: Shape::Any },
    Rule { name: "indirect.node", dtype: Dtype::U16, shape: Shape::Any },
    Rule { name: "indirect.share", dtype: Dtype::U8, shape: Shape::Block },
    Rule { name: "indirect.scale", dtype: Dtype::F32, shape: Shape::Block },
];

/// In `indirect.patch`: a vertex that reflects nothing.
pub const NO_PATCH: u16 = u16::MAX;

/// Every asset has these.
const NEEDED: [&str; 4] = ["mesh.position", "mesh.normal", "mesh.albedo", "mesh.index"];

/// Checks types, shapes, indices and that all numbers and scales are finite.
pub fn tensors(asset: &Asset) -> Result<(), Error> {
    for name in NEEDED {
        if asset.tensor(name).is_none() {
            return Err(wrong(name, "missing"));
        }
    }
    let n_vertices = asset.tensor("mesh.position").and_then(|t| t.shape.first()).copied().unwrap_or(0);
    for (name, tensor) in asset.tensors() {
        if let Some(rule) = RULES.iter().find(|rule| matches(rule.name, name)) {
            known(rule, name, tensor, n_vertices)?;
        }
        if tensor.shape.iter().product::<usize>() != tensor.data.len() {
            return Err(wrong(name, "its shape and its number of values disagree"));
        }
        if let Some(at) = first_not_finite(&tensor.data) {
            return Err(wrong(name, &format!("value {at} is not a finite number")));
        }
    }
    if let Some((name, scale)) = asset.metadata.scale.iter().find(|(_, s)| !s.is_finite() || **s <= 0.0) {
        return Err(wrong(name, &format!("scale {scale} is not a positive number")));
    }
    let is_light = |t: [f32; 3]| t.iter().all(|x| x.is_finite() && *x >= 0.0);
    if let Some(shell) = asset.metadata.shells.iter().find(|s| s.tint.is_some_and(|t| !is_light(t))) {
        return Err(wrong(
            "shells",
            &format!("{} lets through {:?}, not shares of light", shell.name, shell.tint),
        ));
    }
    sparse_rows(asset)?;
    crate::portal_frame::check(asset)?;
    crate::indirect::check(asset)?;
    crate::glossy::check(asset)?;
    match asset.triangles().as_flattened().iter().position(|&v| v as usize >= n_vertices) {
        Some(at) => Err(wrong("mesh.index", &format!("triangle {} points past vertex {n_vertices}", at / 3))),
        None => Ok(()),
    }
}

/// Sparse rows under any prefix that has one of their tensors.
fn sparse_rows(asset: &Asset) -> Result<(), Error> {
    for (name, _) in asset.tensors() {
        let known = [".direct.start", ".direct.index", ".direct.value", ".direct.scale", ".direct.basis"];
        let Some(part) = known.iter().find(|part| name.ends_with(*part)) else { continue };
        let prefix = &name[..name.len() - part.len() + ".direct".len()];
        if asset.tensor(&format!("{prefix}.start")).is_none() {
            return Err(wrong(&format!("{prefix}.start"), "missing"));
        }
        if *part == ".direct.start" {
            Rows::open(asset, prefix)?;
        }
    }
    Ok(())
}

/// Whether a name is that of a rule, with any number for `*`.
fn matches(rule: &str, name: &str) -> bool {
    let Some((before, after)) = rule.split_once('*') else { return rule == name };
    let number = name.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
    number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit()))
}

fn known(rule: &Rule, name: &str, tensor: &Tensor, v: usize) -> Result<(), Error> {
    if tensor.data.dtype() != rule.dtype {
        return Err(wrong(name, &format!("{:?} instead of {:?}", tensor.data.dtype(), rule.dtype)));
    }
    let square = |k: usize| (1..=MAX_COEFFICIENTS).contains(&k) && k.isqrt().pow(2) == k;
    let fits = match (&rule.shape, tensor.shape.as_slice()) {
        (Shape::Vertex, &[a]) => a == v,
        (Shape::VertexTriple, &[a, 3]) => a == v,
        (Shape::TriangleTriple, &[_, 3]) => true,
        (Shape::VertexSquare, &[a, k]) => a == v && square(k),
        (Shape::VertexSquareTriple, &[a, k, 3]) => a == v && square(k),
        (Shape::Any, &[_]) => true,
        (Shape::AnyPair, &[n, 2]) => n > 0,
        (Shape::Block, &[_, LANES]) => true,
        _ => false,
    };
    if fits {
        Ok(())
    } else {
        Err(wrong(name, &format!("shape {:?} does not fit {v} vertices", tensor.shape)))
    }
}

fn first_not_finite(data: &Data) -> Option<usize> {
    match data {
        Data::F16(values) => values.iter().position(|v| !v.is_finite()),
        Data::F32(values) => values.iter().position(|v| !v.is_finite()),
        Data::U8(_) | Data::I8(_) | Data::U16(_) | Data::U32(_) => None,
    }
}

fn wrong(name: &str, what: &str) -> Error {
    Error::Tensor { name: name.to_string(), what: what.to_string() }
}
