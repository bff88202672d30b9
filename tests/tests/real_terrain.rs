//! Mount St Helens, where the real data lies beside the workspace. Not part of the project: its files are not ours.

use std::path::{Path, PathBuf};

use lunette_scenes::{LoadOptions, load};

/// The folder of real terrains, if there is one; says so where there is none.
fn terrains() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/assets/terrain");
    if !folder.is_dir() {
        println!("skipped: there is no {}", folder.display());
        return None;
    }
    Some(folder)
}

#[test]
fn st_helens_is_the_same_mesh_from_both_of_its_files() {
    let Some(folder) = terrains() else { return };
    let read = |name: &str| {
        let path = folder.join(name);
        load(&path.to_string_lossy(), &LoadOptions::default()).expect("Mount St Helens").mesh
    };
    let (dem, asc) = (read("SainteHelens.dem"), read("SainteHelens.asc"));
    assert_eq!(dem.position.len(), 327 * 468);
    assert!(dem.position == asc.position && dem.index == asc.index && dem.normal == asc.normal);
}
