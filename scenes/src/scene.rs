//! The types every scene is made of.

use glam::Vec3;

/// A static scene: one indexed triangle mesh, its materials, and what had to be mended on the way in.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The triangles.
    pub mesh: Mesh,
    /// Materials, indexed by [`Mesh::material`]; never empty.
    pub materials: Vec<Material>,
    /// Object or group names, indexed by [`Mesh::group`]; never empty.
    pub groups: Vec<String>,
    /// One line per kind of thing that was mended or left out, with its count, for the user to read.
    pub report: Vec<String>,
}

/// Indexed triangles. A vertex belongs to one normal and one material: where either changes, it is split,
/// so that light baked per vertex does not bleed over creases or materials.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Metres, \[V\].
    pub position: Vec<Vec3>,
    /// Unit shading normals, \[V\].
    pub normal: Vec<Vec3>,
    /// Vertex indices, counter-clockwise seen from the side the normals point to, \[T\]. Every index is below V.
    pub index: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`], \[T\].
    pub material: Vec<u32>,
    /// Index into [`Scene::groups`], \[T\].
    pub group: Vec<u32>,
}

/// What a surface does to light.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As in the file.
    pub name: String,
    /// Diffuse reflectance (`Kd`), linear Rec.709, in 0..=1.
    pub albedo: Vec3,
    /// Phong specular reflectance (`Ks`), 0..=1.
    pub specular: Vec3,
    /// Phong exponent (`Ns`), 0 and up.
    pub exponent: f32,
    /// Emitted radiance (`Ke`).
    pub emission: Vec3,
    /// Share of light let straight through (`Tf`, `1 - d`), 0 for opaque surfaces.
    pub transmission: Vec3,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            name: String::new(),
            albedo: Vec3::splat(0.5),
            specular: Vec3::ZERO,
            exponent: 0.0,
            emission: Vec3::ZERO,
            transmission: Vec3::ZERO,
        }
    }
}

/// Least transmission, in the channel that has most, of glass. Exporters write `d 0.999` for what is opaque.
const GLASS: f32 = 0.02;

impl Material {
    /// Whether it lets light through that is worth a portal.
    pub fn is_see_through(&self) -> bool {
        self.transmission.max_element() >= GLASS
    }
}

impl Scene {
    /// Diffuse reflectance of each vertex, \[V\]: that of its material.
    pub fn vertex_albedo(&self) -> Vec<Vec3> {
        let mut albedo = vec![Vec3::splat(0.5); self.mesh.position.len()];
        for (triangle, &material) in self.mesh.index.iter().zip(&self.mesh.material) {
            for &v in triangle {
                albedo[v as usize] = self.materials[material as usize].albedo;
            }
        }
        albedo
    }
}

impl Mesh {
    /// Smallest and largest corner of the bounding box; zeros for an empty mesh.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let Some(&first) = self.position.first() else { return (Vec3::ZERO, Vec3::ZERO) };
        self.position.iter().fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)))
    }

    /// A third of the area of the triangles around each vertex, m², \[V\]: the weight of a vertex in a mean.
    pub fn vertex_area(&self) -> Vec<f32> {
        let mut area = vec![0.0; self.position.len()];
        for &[a, b, c] in &self.index {
            let [p, q, r] = [a, b, c].map(|v| self.position[v as usize]);
            let third = (q - p).cross(r - p).length() / 6.0;
            for v in [a, b, c] {
                area[v as usize] += third;
            }
        }
        area
    }
}

/// Why a scene could not be had. `Display` is one line for the user: what, where, what to do.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be read.
    Io {
        /// The file.
        path: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file was read and is wrong.
    Invalid {
        /// File, and line or byte where known.
        at: String,
        /// What is wrong and what to do.
        what: String,
    },
    /// No built-in scene, or a wrong parameter of one.
    Builtin {
        /// What is wrong and what there is.
        what: String,
    },
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::Io { path, source } => write!(f, "{}: {source}", path.display()),
            Error::Invalid { at, what } => write!(f, "{at}: {what}"),
            Error::Builtin { what } => f.write_str(what),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
