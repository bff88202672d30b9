use super::*;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn gradient() -> Image {
    let pixels = (0..15).map(|i| Vec3::new(i as f32, 1e-7 * i as f32, 1e7 / (1.0 + i as f32))).collect();
    Image { width: 5, height: 3, pixels }
}

fn hdr_bytes(pixels: &[[u8; 4]], width: usize) -> Vec<u8> {
    let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {width}\n", pixels.len() / width);
    [head.as_bytes(), pixels.as_flattened()].concat()
}

#[test]
fn exr_round_trip_is_exact() {
    let dir = folder();
    let path = dir.path().join("a.exr");
    write_exr(&path, &gradient()).unwrap();
    assert_eq!(read_image(&path).unwrap(), gradient());
}

#[test]
fn hdr_texels_follow_ward() {
    let dir = folder();
    let path = dir.path().join("a.hdr");
    fs::write(&path, hdr_bytes(&[[128, 64, 0, 129], [255, 255, 255, 0]], 2)).unwrap();
    // Mantissa / 256 times 2^(exponent - 128); exponent 0 is black.
    assert_eq!(read_image(&path).unwrap().pixels, [Vec3::new(1.0, 0.5, 0.0), Vec3::ZERO]);
}

#[test]
fn light_negatives_are_mended_and_counted() {
    let dir = folder();
    let path = dir.path().join("a.exr");
    let mut image = Image::filled(20, 20, Vec3::ONE);
    image.pixels[7] = Vec3::new(-1.0, 1.0, 2.0);
    write_exr(&path, &image).unwrap();
    let light = read_light(&path).unwrap();
    assert_eq!((light.n_negative(), light.pixels()[7]), (1, [0.0, 1.0, 2.0]));
}

#[test]
fn light_of_nans_is_refused() {
    let dir = folder();
    let path = dir.path().join("a.exr");
    write_exr(&path, &Image::filled(4, 4, Vec3::splat(f32::NAN))).unwrap();
    let message = read_light(&path).unwrap_err().to_string();
    assert!(message.contains("NaN") && message.lines().count() == 1, "{message}");
}

#[test]
fn unreadable_images_are_one_line_errors() {
    let dir = folder();
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000000000 +X 4000000000\n".to_vec();
    let empty_size = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 0\n".to_vec();
    let mut huge_exr = exr_bytes(dir.path());
    grow_data_window(&mut huge_exr);
    for (name, bytes) in [
        ("empty.exr", vec![]),
        ("empty.hdr", vec![]),
        ("garbage.exr", b"not an image\n\nat all".to_vec()),
        ("garbage.hdr", b"not an image\n\nat all".to_vec()),
        ("huge.hdr", huge),
        ("zero.hdr", empty_size),
        ("huge.exr", huge_exr),
        ("picture.gif", b"GIF89a".to_vec()),
    ] {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        let message = read_light(&path).unwrap_err().to_string();
        assert!(message.contains(name) && message.lines().count() == 1, "{message}");
    }
    assert!(matches!(read_light(&dir.path().join("none.exr")), Err(Error::Io { .. })));
}

#[test]
fn truncated_or_damaged_images_never_panic() {
    let dir = folder();
    let path = dir.path().join("cut.exr");
    let whole = exr_bytes(dir.path());
    for cut in 0..whole.len() {
        fs::write(&path, &whole[..cut]).unwrap();
        assert!(read_image(&path).is_err(), "cut at {cut}");
    }
    for i in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[i] ^= 0x55;
        fs::write(&path, bytes).unwrap();
        // Many a flipped bit makes another valid image; only a panic would be wrong.
        let _ = read_image(&path);
    }
}

fn exr_bytes(dir: &Path) -> Vec<u8> {
    let path = dir.join("whole.exr");
    write_exr(&path, &gradient()).unwrap();
    fs::read(&path).unwrap()
}

/// Lets the data and display windows end at (2^30, 2^30).
fn grow_data_window(bytes: &mut [u8]) {
    for name in [b"dataWindow\0box2i\0\x10\0\0\0".as_slice(), b"displayWindow\0box2i\0\x10\0\0\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name).expect("attribute") + name.len();
        bytes[at + 8..at + 12].copy_from_slice(&(1i32 << 30).to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&(1i32 << 30).to_le_bytes());
    }
}

#[test]
fn writing_leaves_one_whole_file_or_nothing() {
    let dir = folder();
    let path = dir.path().join("a.png");
    let picture = Picture { width: 2, height: 1, pixels: vec![[255, 0, 1], [2, 3, 4]] };
    write_png(&path, &picture).unwrap();
    write_png(&path, &picture).unwrap();
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    let decoded = image::ImageReader::open(&path).unwrap().decode().unwrap().into_rgb8();
    assert_eq!(decoded.into_raw(), [255, 0, 1, 2, 3, 4]);

    // A folder in the file's place: the rename fails, and the temporary file is taken away again.
    let blocked = dir.path().join("b.png");
    fs::create_dir(&blocked).unwrap();
    fs::write(blocked.join("full"), "").unwrap();
    assert!(write_png(&blocked, &picture).is_err());
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);

    let message = write_png(&dir.path().join("none/a.png"), &picture).unwrap_err().to_string();
    assert!(message.contains("no such folder") && message.lines().count() == 1, "{message}");
}

/// Width, height, mean and maximum of the samples as NumPy and the OpenEXR library read them.
const REAL_SKIES: [(&str, usize, usize, f64, f64); 7] = [
    ("city.exr", 1024, 512, 1.0477936, 33952.0),
    ("forest.exr", 1024, 512, 0.56149095, 1010.5),
    ("grace.hdr", 256, 128, 0.41696291, 3504.0),
    ("kloofendal_48d_partly_cloudy_puresky_1k.hdr", 1024, 512, 0.80192102, 18432.0),
    ("sunset.exr", 1024, 512, 0.4644066, 6520.0),
    ("uffizi.hdr", 256, 128, 1.8583401, 15.875),
    ("venice_sunset_1k.hdr", 1024, 512, 0.46477449, 6496.0),
];

#[test]
fn real_skies_agree_with_other_readers() {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/assets/hdr");
    if !dir.is_dir() {
        println!("skipped: no real skies in {}", dir.display());
        return;
    }
    for (name, width, height, mean, max) in REAL_SKIES {
        let image = read_light(&dir.join(name)).unwrap_or_else(|e| panic!("{e}"));
        let samples = image.pixels().as_flattened().iter().map(|x| f64::from(*x));
        let n = 3.0 * (width * height) as f64;
        let (sum, most) = samples.fold((0.0, 0.0f64), |(s, m), x| (s + x, m.max(x)));
        assert_eq!((image.width(), image.height()), (width, height), "{name}");
        // The lossy DWA codec may decode a half float to its neighbour, 2^-11 away.
        assert!((sum / n / mean - 1.0).abs() < 1e-4, "{name}: mean {} is not {mean}", sum / n);
        assert!((most / max - 1.0).abs() < 1e-3, "{name}: maximum {most} is not {max}");
    }
}
