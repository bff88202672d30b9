//! Each reader on small files made here, on the real quadrangle where it is at hand, and on damaged ones.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

use super::{
    Heights, Wrong, asc, dem, geotiff, heights_to_scene, hgt, load, metres_per_degree, png, read, voids,
};
use crate::{Error, LoadOptions};

const GRID: &str =
    "NCOLS 3\nnrows 2\nXLLCORNER 10\nyllcenter 20\nCellSize 5\nnodata_VALUE -1\n1 2 3\n4 -1 6.5\n";

fn same(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
}

fn message(wrong: Wrong) -> String {
    wrong.at(Path::new("file")).to_string()
}

#[test]
fn asc_header_is_read_in_any_case() {
    let heights = asc::read(GRID.as_bytes()).unwrap();
    assert_eq!((heights.columns, heights.rows, heights.spacing_x, heights.spacing_z), (3, 2, 5.0, 5.0));
    assert!(same(&heights.height, &[1.0, 2.0, 3.0, 4.0, f32::NAN, 6.5]));
}

#[test]
fn asc_cells_may_be_oblong_and_lines_end_as_they_like() {
    let text = "ncols 2\r\nnrows 2\r\ndx 3\r\ndy 4\r\n\r\n1e1\t-2.5\r\n nan -9999";
    let heights = asc::read(text.as_bytes()).unwrap();
    assert_eq!((heights.spacing_x, heights.spacing_z), (3.0, 4.0));
    assert!(same(&heights.height, &[10.0, -2.5, f32::NAN, f32::NAN]));
}

#[test]
fn asc_in_degrees_is_noted() {
    let text = "ncols 2\nnrows 2\nxllcorner -84\nyllcorner 36\ncellsize 0.0008\n1 2\n3 4\n";
    let notes = asc::read(text.as_bytes()).unwrap().notes;
    assert!(notes.len() == 1 && notes[0].contains("degrees"), "{notes:?}");
    assert!(asc::read(GRID.as_bytes()).unwrap().notes.is_empty());
}

#[test]
fn asc_faults_name_their_line() {
    let with = |from: &str, to: &str| message(asc::read(GRID.replace(from, to).as_bytes()).unwrap_err());
    assert!(with("1 2 3", "1 2").starts_with("file:7: has 2 heights"));
    assert!(with("1 2 3", "1 2 3 4").starts_with("file:7: has more"));
    assert!(with("1 2 3", "1 x 3").starts_with("file:7: `x`"));
    assert!(with("1 2 3", "1 inf 3").starts_with("file:7: `inf`"));
    assert!(with("4 -1 6.5\n", "").starts_with("file:7: ends after 1 of 2 rows"));
    assert!(with("6.5\n", "6.5\n7 8 9\n").starts_with("file:9: there is more"));
    assert!(with("NCOLS 3", "NCOLS 4000000000").starts_with("file:6: 4000000000 x 2 posts"));
    assert!(with("NCOLS 3", "NCOLS -3").starts_with("file:1: `NCOLS`"));
    assert!(with("NCOLS 3", "NCOLS 1").contains("no grid"));
    assert!(with("nrows 2\n", "").contains("without `nrows`"));
    assert!(with("nrows 2", "bytes 2").starts_with("file:2: `bytes` is no key"));
    assert!(with("CellSize 5", "CellSize nan").starts_with("file:5:"));
    assert!(message(asc::read(b"\xff\xfe\x00").unwrap_err()).starts_with("file:byte 0"));
}

/// A quadrangle of profiles `(x, y, heights)`, 10 units between and 5 along them.
fn usgs(units: [u32; 2], step: f64, profiles: &[(f64, f64, Vec<i32>)]) -> Vec<u8> {
    let fortran = |x: f64, width: usize| {
        format!("{:>width$}", format!("{x:.9E}").replace('E', "D+").replace("+-", "-"))
    };
    let mut file = vec![b' '; 1024];
    let mut put = |at: usize, text: String| file[at..at + text.len()].copy_from_slice(text.as_bytes());
    put(528, format!("{:6}{:6}{:6}", units[0], units[1], 4));
    for corner in 0..8 {
        put(546 + 24 * corner, fortran(0.0, 24));
    }
    put(786, fortran(0.0, 24));
    put(816, format!("{:>12}{:>12}{:>12}", "10.0", ".5E+01", step));
    put(852, format!("{:6}{:6}", 1, profiles.len()));
    for (i, (x, y, heights)) in profiles.iter().enumerate() {
        let mut record = format!("{:6}{:6}{:6}{:6}", 1, i + 1, heights.len(), 1);
        record += &[*x, *y, 100.0, 0.0, 0.0].map(|v| fortran(v, 24)).concat();
        for (k, h) in heights.iter().enumerate() {
            if k == 146 || (k > 146 && (k - 146) % 170 == 0) {
                record += "    ";
            }
            record += &format!("{h:6}");
        }
        record += &" ".repeat(record.len().next_multiple_of(1024) - record.len());
        file.extend(record.bytes());
    }
    file
}

#[test]
fn usgs_profiles_start_where_they_say() {
    let file = usgs([2, 2], 0.5, &[(1000.0, 505.0, vec![1, 2]), (1010.0, 500.0, vec![3, -32767, 5])]);
    let heights = dem::read(&file).unwrap();
    assert_eq!((heights.columns, heights.rows, heights.spacing_x, heights.spacing_z), (2, 3, 10.0, 5.0));
    // Datum 100, half a metre a step; north first.
    assert!(same(&heights.height, &[101.0, 102.5, 100.5, f32::NAN, f32::NAN, 101.5]));
}

#[test]
fn usgs_feet_and_arc_seconds_become_metres() {
    let profiles = [(0.0, 0.0, vec![0, 10]), (10.0, 0.0, vec![0, 0])];
    let feet = dem::read(&usgs([1, 1], 1.0, &profiles)).unwrap();
    // 110 feet; f32.
    assert!((feet.height[0] - 33.528).abs() < 1e-5 && (feet.spacing_x - 3.048).abs() < 1e-6);
    let seconds = dem::read(&usgs([3, 2], 1.0, &profiles)).unwrap();
    // On the equator a degree of longitude has 111,319.5 m and one of latitude 110,574.3 m.
    assert!((seconds.spacing_x - 309.221).abs() < 0.01, "{}", seconds.spacing_x);
    assert!((seconds.spacing_z - 153.575).abs() < 0.01, "{}", seconds.spacing_z);
}

#[test]
fn usgs_long_profiles_run_over_blocks() {
    let long: Vec<i32> = (0..500).collect();
    let file = usgs([2, 2], 1.0, &[(0.0, 0.0, long.clone()), (10.0, 0.0, long)]);
    let heights = dem::read(&file).unwrap();
    let south_to_north: Vec<f32> = (0..500).map(|r| heights.height[2 * (499 - r)]).collect();
    assert!(south_to_north.iter().enumerate().all(|(i, &h)| h == 100.0 + i as f32));
}

#[test]
fn usgs_faults_name_their_byte() {
    let good = usgs([2, 2], 1.0, &[(0.0, 0.0, vec![1, 2]), (10.0, 0.0, vec![3, 4])]);
    let at = |at: usize, text: &str| {
        let mut file = good.clone();
        file[at..at + text.len()].copy_from_slice(text.as_bytes());
        message(dem::read(&file).unwrap_err())
    };
    assert!(at(858, "999999").starts_with("file:byte 858"));
    assert!(at(528, "     7").starts_with("file:byte 528"));
    assert!(at(816, "         0.0").starts_with("file:byte 816"));
    assert!(at(1024 + 12, "999999").starts_with("file:byte 1036"));
    assert!(at(1024 + 144, "   abc").starts_with("file:byte 1168: `abc`"));
    assert!(at(1024 + 24, "                1.0E+300").contains("do not make a grid"));
    assert!(message(dem::read(&good[..2048]).unwrap_err()).contains("room for 1"));
    assert!(message(dem::read(&good[..1500]).unwrap_err()).contains("is no USGS DEM"));
}

#[test]
fn hgt_is_big_endian_with_voids_and_its_name_is_its_latitude() {
    let mut file = vec![0; 2 * 1201 * 1201];
    file[..6].copy_from_slice(&[0x01, 0x02, 0x80, 0x00, 0xff, 0xff]);
    let heights = hgt::read(&file, "N60E010").unwrap();
    assert!(same(&heights.height[..3], &[258.0, f32::NAN, -1.0]));
    // At 60.5 degrees a degree of longitude has 54,992 m (cos: half and a little less of the equator's).
    assert!((heights.spacing_x * 1200.0 - 54_992.0).abs() < 60.0, "{}", heights.spacing_x * 1200.0);
    assert!((heights.spacing_z * 1200.0 - 111_420.0).abs() < 60.0, "{}", heights.spacing_z * 1200.0);
    assert!(heights.notes.is_empty());
    // The same to the south, and at the equator for another name.
    assert_eq!(hgt::read(&file, "S61w010").unwrap().spacing_x, heights.spacing_x);
    let other = hgt::read(&file, "mountain").unwrap();
    assert!(other.spacing_x > 92.0 && other.notes.len() == 1);
    assert!(message(hgt::read(&file[1..], "N60E010").unwrap_err()).contains("cut off"));
}

#[test]
fn png_of_sixteen_and_eight_bits_hold_metres() {
    let encode = |image: image::DynamicImage| {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let deep = image::ImageBuffer::from_raw(3, 2, vec![0u16, 1, 256, 65535, 4, 5]).unwrap();
    let heights = png::read(&encode(image::DynamicImage::ImageLuma16(deep))).unwrap();
    assert_eq!((heights.columns, heights.rows, heights.spacing_x), (3, 2, 1.0));
    assert!(same(&heights.height, &[0.0, 1.0, 256.0, 65535.0, 4.0, 5.0]));
    let flat = image::ImageBuffer::from_raw(2, 2, vec![0u8, 1, 2, 255]).unwrap();
    assert!(same(
        &png::read(&encode(image::DynamicImage::ImageLuma8(flat))).unwrap().height,
        &[0.0, 1.0, 2.0, 255.0]
    ));
    let coloured = encode(image::DynamicImage::new_rgb8(2, 2));
    assert!(message(png::read(&coloured).unwrap_err()).contains("grey"));
    assert!(message(png::read(&coloured[..40]).unwrap_err()).contains("no PNG"));
}

/// A GeoTIFF of 2 x 2 samples with a pixel scale of 0.5 by 0.25, tied at (10, 60).
fn tiff<C>(samples: &[C::Inner], nodata: &str, keys: &[u16]) -> Vec<u8>
where
    C: colortype::ColorType,
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<C>(2, 2).unwrap();
    let directory = image.encoder();
    directory.write_tag(Tag::ModelPixelScaleTag, &[0.5, 0.25, 0.0][..]).unwrap();
    directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, 10.0, 60.25, 0.0][..]).unwrap();
    directory.write_tag(Tag::GeoKeyDirectoryTag, keys).unwrap();
    directory.write_tag(Tag::GdalNodata, nodata).unwrap();
    image.write_data(samples).unwrap();
    bytes.into_inner()
}

#[test]
fn geotiff_of_every_sample_kind_is_read() {
    let metric = [1, 1, 0, 1, 1024, 0, 1, 1];
    let expected = [1.0, f32::NAN, 3.0, 100.0];
    let files = [
        tiff::<colortype::Gray16>(&[1, 2, 3, 100], "2", &metric),
        tiff::<colortype::GrayI16>(&[1, -32768, 3, 100], "-32768", &metric),
        tiff::<colortype::GrayI32>(&[1, -9999, 3, 100], "-9999", &metric),
        tiff::<colortype::Gray8>(&[1, 255, 3, 100], "255", &metric),
        tiff::<colortype::Gray32Float>(&[1.0, -3.4028235e38, 3.0, 100.0], "-3.4028234663852886e+38", &metric),
        tiff::<colortype::Gray32Float>(&[1.0, f32::NAN, 3.0, 100.0], "nan", &metric),
        tiff::<colortype::Gray64Float>(&[1.0, 1e20, 3.0, 100.0], "1e20", &metric),
    ];
    for (i, file) in files.iter().enumerate() {
        let heights = geotiff::read(file).unwrap();
        assert!(same(&heights.height, &expected), "{i}: {:?}", heights.height);
        assert_eq!((heights.spacing_x, heights.spacing_z), (0.5, 0.25));
    }
}

#[test]
fn geotiff_degrees_and_feet_become_metres() {
    let degrees = tiff::<colortype::Gray16>(&[1, 2, 3, 4], "0", &[1, 1, 0, 1, 1024, 0, 1, 2]);
    let heights = geotiff::read(&degrees).unwrap();
    let [east, north] = metres_per_degree(60.0);
    assert_eq!([heights.spacing_x, heights.spacing_z], [(0.5 * east) as f32, (0.25 * north) as f32]);
    // GeoKeys: 3076 projected unit and 4099 vertical unit, both 9002, the foot.
    let feet = [1, 1, 0, 3, 1024, 0, 1, 1, 3076, 0, 1, 9002, 4099, 0, 1, 9002];
    let heights = geotiff::read(&tiff::<colortype::Gray16>(&[1, 2, 3, 4], "0", &feet)).unwrap();
    assert!((heights.spacing_x - 0.1524).abs() < 1e-6 && (heights.height[3] - 1.2192).abs() < 1e-6);
}

#[test]
fn metres_per_degree_agree_with_the_ellipsoid() {
    // WGS84 by the closed form: a cos(phi) / sqrt(1 - e² sin²) and a (1 - e²) / (1 - e² sin²)^1.5, per degree.
    let (a, e2) = (6_378_137.0_f64, 0.006_694_379_990_14);
    for latitude in [-75.0_f64, -30.0, 0.0, 46.2, 60.0, 85.0] {
        let (sin, cos) = latitude.to_radians().sin_cos();
        let w = (1.0 - e2 * sin * sin).sqrt();
        let exact = [a * cos / w, a * (1.0 - e2) / w.powi(3)].map(|r| r * std::f64::consts::PI / 180.0);
        for (series, exact) in metres_per_degree(latitude).iter().zip(exact) {
            // The series is rounded to centimetres and cut after three terms.
            assert!((series - exact).abs() < 2.0, "{latitude}: {series} {exact}");
        }
    }
}

#[test]
fn mesh_is_east_up_south_with_normals_from_slopes() {
    let height = (0..12).map(|i| 2.0 * (i % 4) as f32 + 0.5 * (i / 4) as f32).collect();
    let scene = heights_to_scene(Heights::new(4, 3, [2.0, 5.0], height)).unwrap();
    let mesh = &scene.mesh;
    assert_eq!(mesh.position[0], glam::vec3(-3.0, 0.0, -5.0));
    assert_eq!(mesh.position[11], glam::vec3(3.0, 7.0, 5.0));
    // A tilted plane: h rises by 1 a metre eastwards and 0.1 southwards, at every post alike.
    let normal = glam::vec3(-1.0, 1.0, -0.1).normalize();
    assert!(mesh.normal.iter().all(|n| n.distance(normal) < 1e-6));
    assert_eq!(mesh.index.len(), 12);
    for &[a, b, c] in &mesh.index {
        let [a, b, c] = [a, b, c].map(|v| mesh.position[v as usize]);
        assert!((b - a).cross(c - a).normalize().distance(normal) < 1e-6);
    }
}

#[test]
fn voids_in_a_tilted_plane_are_filled_with_the_plane() {
    let plane = |i: usize| 3.0 * (i % 40) as f32 - 2.0 * (i / 40) as f32;
    let mut height: Vec<f32> = (0..1600).map(plane).collect();
    for y in 12..26 {
        height[40 * y + 9..40 * y + 31].fill(f32::NAN);
    }
    let filled = voids::fill(40, 40, &mut height).unwrap();
    assert_eq!(filled, voids::Filled { voids: 14 * 22, at_border: 0 });
    // A plane is its own membrane; the hole's relief is 3 * 22 m, of which the sweeps may leave one per cent.
    let worst = height.iter().enumerate().map(|(i, h)| (h - plane(i)).abs()).fold(0.0, f32::max);
    assert!(worst < 0.66, "{worst}");
}

#[test]
fn voids_stay_within_the_heights_around_and_are_counted() {
    let mut height = vec![f32::NAN; 30 * 20];
    height[30 * 7 + 11] = -5.0;
    height[30 * 9 + 3] = 12.0;
    let filled = voids::fill(30, 20, &mut height).unwrap();
    assert_eq!(filled, voids::Filled { voids: 598, at_border: 598 });
    // A membrane has no extrema of its own; a little for rounding.
    assert!(height.iter().all(|h| (-5.001..=12.001).contains(h)));
    assert_eq!(voids::fill(2, 2, &mut [f32::NAN; 4]), None);
    assert_eq!(voids::fill(2, 2, &mut [1.0; 4]).unwrap().voids, 0);
}

fn saved(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test]
fn load_scales_and_reports() {
    let (_folder, path) = saved("Grid.ASC", GRID.as_bytes());
    let options = LoadOptions { scale: 2.0, vertical_scale: 10.0, ..LoadOptions::default() };
    let scene = load(&path, &options).unwrap();
    assert_eq!(scene.mesh.position[5], glam::vec3(10.0, 65.0, 5.0));
    assert_eq!(scene.report.len(), 1);
    assert!(scene.report[0].contains("1 of 6 heights (16.67 %)"), "{}", scene.report[0]);
    assert!((scene.mesh.position[4].y - 10.0 * (2.0 + 4.0 + 6.5) / 3.0).abs() < 1e-3);
}

#[test]
fn load_refuses_in_one_line() {
    let refused = |name: &str, bytes: &[u8]| {
        let (_folder, path) = saved(name, bytes);
        let line = load(&path, &LoadOptions::default()).unwrap_err().to_string();
        assert!(!line.contains('\n') && line.contains(name), "{line}");
        line
    };
    assert!(refused("a.asc", b"").contains("is empty"));
    assert!(refused("a.asc", b"ncols 2\nnrows 2\ncellsize 1\n-9999 -9999\n-9999 -9999").contains("void"));
    assert!(refused("a.asc", b"ncols 2\nnrows 2\ncellsize 1\n1 2\n3 1e30").contains("row 2, column 2"));
    assert!(refused("a.asc", b"ncols 2\nnrows 2\ncellsize 0\n1 2\n3 4").contains("spacing"));
    for name in ["a.asc", "a.dem", "a.hgt", "a.png", "a.tif"] {
        refused(name, &[7; 5000]);
    }
    let missing = load(Path::new("nowhere/a.asc"), &LoadOptions::default()).unwrap_err();
    assert!(matches!(missing, Error::Io { .. }));
}

#[test]
fn st_helens_is_the_same_from_dem_and_asc() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/assets/terrain");
    let [dem, asc] = ["SainteHelens.dem", "SainteHelens.asc"].map(|name| folder.join(name));
    if !dem.exists() || !asc.exists() {
        println!("skipped: no {}", folder.display());
        return;
    }
    let [a, b] = [&dem, &asc].map(|path| read(path).unwrap());
    assert_eq!((a.columns, a.rows, a.spacing_x, a.spacing_z), (327, 468, 30.0, 30.0));
    assert!(same(&a.height, &b.height));
    let [a, b] = [&dem, &asc].map(|path| load(path, &LoadOptions::default()).unwrap());
    assert!(
        a.mesh.position == b.mesh.position && a.mesh.normal == b.mesh.normal && a.mesh.index == b.mesh.index
    );
    assert_eq!(a.report, b.report);
}

/// A good file with some bytes changed and its end cut off.
fn damaged(good: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let changes = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6);
    (changes, prop::option::of(any::<prop::sample::Index>())).prop_map(move |(changes, cut)| {
        let mut file = good.clone();
        for (at, value) in changes {
            let at = at.index(file.len());
            file[at] = value;
        }
        file.truncate(cut.map_or(file.len(), |cut| cut.index(file.len())));
        file
    })
}

/// A scene without a NaN, or one line.
fn survives(heights: Result<Heights, Wrong>) -> Result<(), TestCaseError> {
    match heights.and_then(super::check).map_err(message).and_then(heights_to_scene) {
        Ok(scene) => prop_assert!(scene.mesh.position.iter().all(|p| p.is_finite())),
        Err(line) => prop_assert!(!line.contains('\n')),
    }
    Ok(())
}

fn small_png() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image::DynamicImage::new_luma16(5, 4).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_asc_survives(file in damaged(GRID.as_bytes().to_vec())) {
        survives(asc::read(&file))?;
    }

    #[test]
    fn damaged_dem_survives(
        file in damaged(usgs([2, 2], 1.0, &[(0.0, 0.0, vec![1, 2]), (10.0, 0.0, vec![3, 4, 5])])),
    ) {
        survives(dem::read(&file))?;
    }

    #[test]
    fn damaged_png_survives(file in damaged(small_png())) {
        survives(png::read(&file))?;
    }

    #[test]
    fn damaged_geotiff_survives(
        file in damaged(tiff::<colortype::Gray32Float>(&[1.0, 2.0, 3.0, 4.0], "2", &[1, 1, 0, 1, 1024, 0, 1, 2])),
    ) {
        survives(geotiff::read(&file))?;
    }
}

proptest! {
    // A tile has millions of posts, so a few will do.
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn damaged_hgt_survives(file in damaged(vec![1; 2 * 1201 * 1201]), name in ".{0,5}") {
        survives(hgt::read(&file, &name))?;
    }
}
