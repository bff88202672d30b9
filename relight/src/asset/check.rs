//! What must hold of the tensors before anyone indexes with them.

use safetensors::Dtype;

use super::{Asset, Data, Error, Tensor};
use crate::sh::MAX_COEFFICIENTS;

/// Type and shape that a known tensor must have.
struct Rule {
    name: &'static str,
    dtype: Dtype,
    shape: Shape,
}

/// V vertices, T triangles, n² a square up to 100.
enum Shape {
    Vertex,
    VertexTriple,
    TriangleTriple,
    VertexSquare,
    VertexSquareTriple,
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
];

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
        if let Some(rule) = RULES.iter().find(|rule| rule.name == name) {
            known(rule, tensor, n_vertices)?;
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
    match asset.triangles().as_flattened().iter().position(|&v| v as usize >= n_vertices) {
        Some(at) => Err(wrong("mesh.index", &format!("triangle {} points past vertex {n_vertices}", at / 3))),
        None => Ok(()),
    }
}

fn known(rule: &Rule, tensor: &Tensor, v: usize) -> Result<(), Error> {
    if tensor.data.dtype() != rule.dtype {
        return Err(wrong(rule.name, &format!("{:?} instead of {:?}", tensor.data.dtype(), rule.dtype)));
    }
    let square = |k: usize| (1..=MAX_COEFFICIENTS).contains(&k) && k.isqrt().pow(2) == k;
    let fits = match (&rule.shape, tensor.shape.as_slice()) {
        (Shape::Vertex, &[a]) => a == v,
        (Shape::VertexTriple, &[a, 3]) => a == v,
        (Shape::TriangleTriple, &[_, 3]) => true,
        (Shape::VertexSquare, &[a, k]) => a == v && square(k),
        (Shape::VertexSquareTriple, &[a, k, 3]) => a == v && square(k),
        _ => false,
    };
    if fits {
        Ok(())
    } else {
        Err(wrong(rule.name, &format!("shape {:?} does not fit {v} vertices", tensor.shape)))
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
