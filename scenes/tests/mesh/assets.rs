//! Real files, where they are at hand.

use std::path::Path;

use lunette_scenes::{LoadOptions, load};

use crate::assert_valid;

/// What is known of a file.
struct Known {
    file: &'static str,
    /// Triangles in the file.
    n_triangles: usize,
    /// Triangles that are left out, and what the report says of them.
    left_out: &'static [(usize, &'static str)],
    /// Materials of the mesh, used or not.
    n_materials: usize,
}

const BOTH_SIDES: &str = "in the place of another that faces the other way left out";
const COINCIDENT: &str = "in the place of another left out";
const ZERO_AREA: &str = "zero-area";

/// Counts of triangles without area or in the same place were found by another program, in f64.
const KNOWN: [Known; 8] = [
    Known {
        file: "interiors/cornell_box/CornellBox-Original.obj",
        n_triangles: 36,
        left_out: &[(4, COINCIDENT)],
        n_materials: 8,
    },
    Known {
        file: "interiors/cornell_embree/cornell_box.obj",
        n_triangles: 34,
        left_out: &[],
        n_materials: 5,
    },
    Known {
        file: "interiors/sponza/sponza.obj",
        n_triangles: 66_445,
        left_out: &[(2, COINCIDENT)],
        n_materials: 20,
    },
    Known {
        file: "interiors/sibenik/sibenik_open.obj",
        n_triangles: 73_564,
        left_out: &[(8, ZERO_AREA), (151, COINCIDENT), (1, BOTH_SIDES)],
        n_materials: 15,
    },
    Known {
        file: "interiors/living_room/living_room.obj",
        n_triangles: 143_163,
        left_out: &[(190, ZERO_AREA)],
        n_materials: 19,
    },
    Known {
        file: "interiors/classroom/classroom.obj",
        n_triangles: 103_832,
        left_out: &[(2, ZERO_AREA)],
        n_materials: 44,
    },
    Known { file: "objects/stanford-bunny.obj", n_triangles: 69_451, left_out: &[], n_materials: 1 },
    Known {
        file: "objects/dragon_vrip_res3.ply",
        n_triangles: 47_794,
        left_out: &[(138, COINCIDENT), (1116, BOTH_SIDES)],
        n_materials: 1,
    },
];

#[test]
fn real_scenes_load_with_known_counts() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/assets");
    for known in KNOWN {
        let path = folder.join(known.file);
        if !path.exists() {
            eprintln!("skipped: {} is not there", known.file);
            continue;
        }
        let scene = load(path.to_str().expect("a plain path"), &LoadOptions::default())
            .expect("the file can be mended");
        assert_valid(&scene);
        let n_left_out: usize = known.left_out.iter().map(|(n, _)| n).sum();
        assert_eq!(scene.mesh.index.len(), known.n_triangles - n_left_out, "{}", known.file);
        assert_eq!(scene.materials.len(), known.n_materials, "{}", known.file);
        for (n, what) in known.left_out {
            let is_told = |line: &String| line.starts_with(&format!("{n} ")) && line.contains(what);
            assert!(scene.report.iter().any(is_told), "{}: {n} {what}: {:?}", known.file, scene.report);
        }
    }
}
