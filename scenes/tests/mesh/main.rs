//! Mesh files as they are found: loading, mending, writing, subdividing.

mod assets;
mod garbage;
mod mtl;
mod obj;
mod ply;
mod subdivision;
mod writing;

use std::fs;

use lunette_scenes::{Error, LoadOptions, Scene, load};

/// Loads the first of some files that lie in one folder.
fn load_files(files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Scene, Error> {
    let folder = tempfile::tempdir().expect("a folder for the test");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("the folder can be written to");
    }
    load(folder.path().join(files[0].0).to_str().expect("a plain path"), options)
}

/// The error, with the folder taken off its front.
fn error_of(loaded: Result<Scene, Error>) -> String {
    let line = loaded.expect_err("the file is wrong").to_string();
    assert!(!line.contains('\n'), "one line: {line:?}");
    line.rsplit('/').next().expect("there is a last part").to_owned()
}

/// Whether the scene keeps what its types promise.
fn assert_valid(scene: &Scene) {
    let mesh = &scene.mesh;
    let n = mesh.position.len();
    assert_eq!(mesh.normal.len(), n);
    assert_eq!([mesh.material.len(), mesh.group.len()], [mesh.index.len(); 2]);
    assert!(mesh.position.iter().all(|p| p.is_finite()));
    assert!(mesh.normal.iter().all(|normal| normal.is_normalized()));
    assert!(mesh.index.iter().flatten().all(|&v| (v as usize) < n));
    assert!(mesh.material.iter().all(|&m| (m as usize) < scene.materials.len()));
    assert!(mesh.group.iter().all(|&g| (g as usize) < scene.groups.len()));
    assert!(scene.materials.iter().all(|m| m.albedo.is_finite() && m.albedo.max_element() <= 1.0));
    assert!(!mesh.index.is_empty() && !scene.materials.is_empty() && !scene.groups.is_empty());
    for t in &mesh.index {
        let [a, b, c] = t.map(|v| mesh.position[v as usize].as_dvec3());
        let face = (b - a).cross(c - a);
        assert!(face.length() > 0.0, "a triangle without area");
        assert!(
            t.iter().all(|&v| face.dot(mesh.normal[v as usize].as_dvec3()) > 0.0),
            "a normal behind its face"
        );
    }
}

/// Area of all triangles, m².
fn area(scene: &Scene) -> f32 {
    let mesh = &scene.mesh;
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| mesh.position[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    };
    mesh.index.iter().map(of).sum()
}
