//! The baked file: one safetensors document with a scene, its transfer and a description.
//!
//! [`Asset::from_bytes`] borrows from the caller's bytes (read or memory-mapped) and checks everything before
//! anything is used: the layout, the version, a checksum over description and payload, the shape and type of
//! each tensor, every index, and that every number is finite. A wrong byte anywhere is an [`Error`], never a
//! panic. [`Asset::to_bytes`] gives the same bytes for the same content.
//!
//! Tensors (V vertices, T triangles): `mesh.position`, `mesh.normal`, `mesh.albedo` f32 \[V,3\], `mesh.index` u32
//! \[T,3\]; `sky.ao` f16 \[V\], `sky.bent` f16 \[V,3\], `sky.aperture` f16 \[V\] (cap radius, radians),
//! `sky.direct.sh` f16 \[V,n²\], `sky.indirect.sh` f16 \[V,m²,3\]; `sky.direct.*` and `portal.K.direct.*` as
//! [`sparse`](crate::sparse) has them, `portal.K.indirect.sh` f16 \[V,m²,3\]; `indirect.*` as
//! [`indirect`](crate::indirect) has them, `portal.K.corner`, `portal.K.polygon` and `portal.K.open` as
//! [`portal_frame`](crate::portal_frame) has them, `glossy.*` as [`glossy`](crate::glossy) has them. What is not baked is not there. A stored value
//! times the tensor's scale ([`Metadata::scale`], 1 where absent) is the value meant.

mod check;
mod error;
mod tensor;

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use half::f16;
use safetensors::SafeTensors;
use serde::{Deserialize, Serialize};

pub use check::NO_PATCH;
pub use error::Error;
pub use tensor::{Data, Tensor};

/// The format version that this library writes, and the only one that it reads so far.
pub const VERSION: u32 = 1;

/// Key of the one JSON document in the safetensors header.
const DOCUMENT: &str = "lunette";

/// Every convention in one line, for a reader who has nothing but the file.
pub const CONVENTIONS: &str = "right-handed, Y up, metres, linear Rec.709; irradiance without the receiver's albedo; real SH, \
     orthonormal, index l(l+1)+m, Condon-Shortley sign, Cartesian in world x, y, z";

/// The description that travels with the tensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// Format version, [`VERSION`].
    pub version: u32,
    /// Name and version of the program that wrote the file.
    pub tool: String,
    /// [`CONVENTIONS`].
    pub conventions: String,
    /// What was baked: a file name or the name of a built-in scene.
    pub scene: String,
    /// Hash of positions, normals, indices and albedo, in hexadecimal.
    pub scene_hash: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Options of the bake, as given.
    pub options: BTreeMap<String, serde_json::Value>,
    /// What light comes through; the sky first.
    pub shells: Vec<Shell>,
    /// Factor of each tensor whose stored values are not the values meant.
    pub scale: BTreeMap<String, f32>,
    /// CRC-32 of everything else, in hexadecimal; written by [`Asset::to_bytes`].
    pub checksum: String,
}

/// A sphere of incoming radiance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shell {
    /// `sky`, or the name of the portal.
    pub name: String,
    /// Centre of a portal, metres; absent for the sky, which is at infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f32; 3]>,
    /// Mean unit normal of a portal, pointing inside.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f32; 3]>,
    /// Area of a portal, m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<f32>,
    /// Share of the light that a portal's own glass lets through, per colour; all of it where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tint: Option<[f32; 3]>,
}

impl Metadata {
    /// A description with this library's version and conventions, the sky as its only shell, and no scales.
    pub fn new(scene: &str) -> Metadata {
        Metadata {
            version: VERSION,
            tool: concat!("lunette ", env!("CARGO_PKG_VERSION")).to_string(),
            conventions: CONVENTIONS.to_string(),
            scene: scene.to_string(),
            scene_hash: String::new(),
            seed: 0,
            options: BTreeMap::new(),
            shells: vec![Shell { name: "sky".to_string(), ..Shell::default() }],
            scale: BTreeMap::new(),
            checksum: String::new(),
        }
    }

    /// The factor between stored and meant values of a tensor.
    pub fn scale(&self, tensor: &str) -> f32 {
        self.scale.get(tensor).copied().unwrap_or(1.0)
    }
}

/// A baked scene: description and tensors, borrowed from the caller's bytes where their alignment allows it.
#[derive(Clone, Debug)]
pub struct Asset<'a> {
    /// The description.
    pub metadata: Metadata,
    tensors: BTreeMap<String, Tensor<'a>>,
}

impl<'a> Asset<'a> {
    /// An asset without tensors.
    pub fn new(metadata: Metadata) -> Asset<'a> {
        Asset { metadata, tensors: BTreeMap::new() }
    }

    /// Reads and checks an asset. Costs one pass over the bytes; tensors are borrowed from them.
    ///
    /// # Errors
    /// When the bytes are not a whole, unharmed asset of a known version.
    pub fn from_bytes(bytes: &'a [u8]) -> Result<Asset<'a>, Error> {
        let (_, header) =
            SafeTensors::read_metadata(bytes).map_err(|e| Error::NotSafetensors(e.to_string()))?;
        let document = header.metadata().as_ref().and_then(|m| m.get(DOCUMENT)).ok_or(Error::OtherProgram)?;
        let version: VersionOnly =
            serde_json::from_str(document).map_err(|e| Error::Description(e.to_string()))?;
        if version.version != VERSION {
            return Err(Error::Version(version.version));
        }
        let metadata: Metadata =
            serde_json::from_str(document).map_err(|e| Error::Description(e.to_string()))?;
        let file = SafeTensors::deserialize(bytes).map_err(|e| Error::NotSafetensors(e.to_string()))?;
        let mut tensors = BTreeMap::new();
        for (name, view) in file.iter() {
            tensors.insert(name.to_string(), Tensor::from_view(name, &view)?);
        }
        let asset = Asset { metadata, tensors };
        let sum = asset.checksum(document);
        if sum != asset.metadata.checksum {
            return Err(Error::Checksum { stored: asset.metadata.checksum, computed: sum });
        }
        check::tensors(&asset)?;
        Ok(asset)
    }

    /// The bytes of the file. The same content gives the same bytes.
    ///
    /// # Errors
    /// When the content would not pass the checks of [`Asset::from_bytes`].
    pub fn to_bytes(&self) -> Result<Vec<u8>, Error> {
        check::tensors(self)?;
        self.unchecked_bytes()
    }

    fn unchecked_bytes(&self) -> Result<Vec<u8>, Error> {
        let mut metadata = self.metadata.clone();
        metadata.checksum = "0".repeat(8);
        let describe = |m: &Metadata| serde_json::to_string(m).map_err(|e| Error::Description(e.to_string()));
        metadata.checksum = self.checksum(&describe(&metadata)?);
        let document = HashMap::from([(DOCUMENT.to_string(), describe(&metadata)?)]);
        safetensors::serialize(
            self.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor)),
            Some(document),
        )
        .map_err(|e| Error::NotSafetensors(e.to_string()))
    }

    /// CRC-32 of the document with its own checksum blanked, then of each tensor in the order of names.
    fn checksum(&self, document: &str) -> String {
        let mut crc = crc32fast::Hasher::new();
        let field = "\"checksum\":\"";
        let (before, after) = document.rsplit_once(field).unwrap_or((document, ""));
        crc.update(before.as_bytes());
        crc.update(after.get(8..).unwrap_or(after).as_bytes());
        for (name, tensor) in &self.tensors {
            crc.update(name.as_bytes());
            crc.update(format!("{:?}{:?}", tensor.data.dtype(), tensor.shape).as_bytes());
            crc.update(tensor.data.bytes());
        }
        format!("{:08x}", crc.finalize())
    }

    /// Adds or replaces a tensor.
    pub fn insert(&mut self, name: &str, shape: &[usize], data: Data<'a>) {
        self.tensors.insert(name.to_string(), Tensor { shape: shape.to_vec(), data });
    }

    /// Adds f16 values, scaled by a power of two where the largest of them would leave the range in which f16
    /// keeps eleven bits, so that small values lose nothing.
    pub fn insert_scaled(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let scale = half_scale(values);
        let data: Vec<f16> = values.iter().map(|v| f16::from_f32(v / scale)).collect();
        self.insert(name, shape, Data::F16(Cow::Owned(data)));
        self.metadata.scale.remove(name);
        if scale != 1.0 {
            self.metadata.scale.insert(name.to_string(), scale);
        }
    }

    /// A tensor by name.
    pub fn tensor(&self, name: &str) -> Option<&Tensor<'a>> {
        self.tensors.get(name)
    }

    /// All tensors in the order of their names.
    pub fn tensors(&self) -> impl Iterator<Item = (&str, &Tensor<'a>)> {
        self.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor))
    }

    /// V.
    pub fn n_vertices(&self) -> usize {
        self.tensor("mesh.position").map_or(0, |t| t.shape[0])
    }

    /// Metres, \[V\].
    pub fn positions(&self) -> &[[f32; 3]] {
        self.triples("mesh.position")
    }

    /// Unit shading normals, \[V\].
    pub fn normals(&self) -> &[[f32; 3]] {
        self.triples("mesh.normal")
    }

    /// Diffuse reflectance, linear Rec.709, \[V\].
    pub fn albedo(&self) -> &[[f32; 3]] {
        self.triples("mesh.albedo")
    }

    /// Triangles, \[T\]; every index is below V.
    pub fn triangles(&self) -> &[[u32; 3]] {
        match self.tensor("mesh.index").map(|t| &t.data) {
            Some(Data::U32(values)) => bytemuck::cast_slice(values),
            _ => &[],
        }
    }

    /// The stored values of an f16 tensor, and the factor that turns them into the values meant.
    pub fn half(&self, name: &str) -> Option<(&[f16], f32)> {
        match &self.tensor(name)?.data {
            Data::F16(values) => Some((values, self.metadata.scale(name))),
            _ => None,
        }
    }

    /// The largest SH order of a tensor `[V, n²]` or `[V, n², 3]`.
    pub fn order(&self, name: &str) -> Option<usize> {
        self.tensor(name).map(|t| t.shape.get(1).copied().unwrap_or(0).isqrt())
    }

    fn triples(&self, name: &str) -> &[[f32; 3]] {
        match self.tensor(name).map(|t| &t.data) {
            Some(Data::F32(values)) => bytemuck::cast_slice(values),
            _ => &[],
        }
    }
}

#[derive(Deserialize)]
struct VersionOnly {
    version: u32,
}

/// A power of two by which to divide so that the largest magnitude lies in 1..2; 1 where it already lies in
/// 1/16..=2^14, from which f16 reaches six decades down.
fn half_scale(values: &[f32]) -> f32 {
    let largest = values.iter().fold(0.0f32, |a, v| a.max(v.abs()));
    if largest == 0.0 || !largest.is_finite() || (1.0 / 16.0..=16384.0).contains(&largest) {
        return 1.0;
    }
    largest.log2().floor().exp2()
}

#[cfg(test)]
mod tests;
