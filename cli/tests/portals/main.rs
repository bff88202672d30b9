//! `lunette portals`, and bakes through what it found: by glass, and by a plain hole where the glass was.

use std::path::PathBuf;
use std::process::{Command, Output};

use lunette_relight::asset::{Asset, Data};

/// Enough for a room with one window, in a second.
const EFFORT: [&str; 4] = ["--cells", "20000", "--size", "320x140"];

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).expect(name)
    }

    fn try_run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lunette"));
        command.args(arguments).current_dir(self.0.path()).output().expect("the lunette command")
    }

    /// What it says on stdout and on stderr.
    fn run(&self, arguments: &[&str]) -> (String, String) {
        let output = self.try_run(arguments);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        (text(&output.stdout), text(&output.stderr))
    }

    fn portals(&self, arguments: &[&str]) -> (String, String) {
        self.run(&[&["portals"], arguments, &EFFORT].concat())
    }

    /// A room of 3017 vertices with a pane, and the same with a hole.
    fn room(&self) {
        self.run(&["scene", "box-room:edge=0.4", "-o", "room.obj"]);
        let mut is_glass = false;
        let without = |line: &&str| {
            is_glass = if line.starts_with("usemtl") { *line == "usemtl glass" } else { is_glass };
            !(is_glass && line.starts_with("f "))
        };
        let hole: Vec<String> =
            self.read("room.obj").lines().filter(without).map(|l| format!("{l}\n")).collect();
        std::fs::write(self.path("hole.obj"), hole.concat()).expect("hole.obj");
    }

    /// Light under an overcast sky, direct and bounced once, by vertices.
    fn lit(&self, scene: &str, options: &[&str]) -> Lit {
        let effort = ["--bounces", "1", "--basis", "sh", "--resolution", "16", "-o", "baked.safetensors"];
        self.run(&[&["bake", scene], options, &effort].concat());
        self.run(&["relight", "baked.safetensors", "--light", "cie-overcast", "-o", "lit.safetensors"]);
        let bytes = std::fs::read(self.path("lit.safetensors")).expect("lit.safetensors");
        let asset = Asset::from_bytes(&bytes).expect("what relight wrote");
        let of = |name: &str| match &asset.tensor(name).expect(name).data {
            Data::F32(values) => values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect::<Vec<_>>(),
            _ => panic!("{name} is no f32"),
        };
        Lit { position: asset.positions().to_vec(), direct: of("direct"), total: of("irradiance") }
    }
}

struct Lit {
    position: Vec<[f32; 3]>,
    direct: Vec<[f32; 3]>,
    total: Vec<[f32; 3]>,
}

/// Sum |a - b| / sum b, and sum a / sum b, over the vertices within the room, not in the reveal of its window.
fn difference(lit: &Lit, a: &[[f32; 3]], b: &[[f32; 3]]) -> (f32, f32) {
    let [mut off, mut sum_a, mut sum_b] = [0.0; 3];
    for ((a, b), _) in a.iter().zip(b).zip(&lit.position).filter(|(_, p)| p[0] > -1.95) {
        for (a, b) in a.iter().zip(b) {
            off += (a - b).abs();
            sum_a += a;
            sum_b += b;
        }
    }
    assert!(sum_b > 0.0, "nothing is lit");
    (off / sum_b, sum_a / sum_b)
}

#[test]
fn pane_is_found_listed_written_and_drawn() {
    let folder = Folder::new();
    let (listed, _) = folder.portals(&["box-room:edge=0.4"]);
    let words: Vec<&str> = listed.lines().next().expect("a line").split_whitespace().collect();
    let pane = "glass 1 polygon 1.920 m² centre -2.12 1.60 0.00 inwards 1.00 0.00 0.00";
    assert_eq!(words.join(" ").replace("-0.00", "0.00"), pane);
    assert!(listed.contains("0.0 % of the light that enters does so elsewhere"), "{listed}");
    assert!(listed.contains("box-room.portals.json: 1 portal, 1.920 m²"), "{listed}");
    let document: serde_json::Value = serde_json::from_str(&folder.read("box-room.portals.json")).unwrap();
    assert_eq!(document["portals"][0]["polygons"][0].as_array().unwrap().len(), 4);
    assert!((document["portals"][0]["transmission"][0].as_f64().unwrap() - 0.9).abs() < 1e-6);
    // Both halves of the picture show the pane in the first colour, 230 159 0.
    let picture = image::open(folder.path("box-room.portals.png")).unwrap().to_rgb8();
    let (picture, width, half) = (&picture, picture.width() as usize, picture.width() as usize / 2);
    // Tone mapping takes a little off what is bright.
    let is_orange = |[r, g, b]: [u8; 3]| r > 200 && (130..180).contains(&g) && b < 40;
    let n_orange = |from: usize| {
        let row = |y: u32| (from..from + half).filter(move |x| is_orange(picture.get_pixel(*x as u32, y).0));
        (0..picture.height()).flat_map(row).count()
    };
    // A hundredth of each half: the window is what they look at.
    let enough = width * picture.height() as usize / 200;
    assert!(n_orange(0) > enough && n_orange(half) > enough, "{} {}", n_orange(0), n_orange(half));
}

#[test]
fn portal_file_is_replaced_only_where_that_is_asked_for() {
    let folder = Folder::new();
    let scene = "box-room:edge=0.4";
    folder.portals(&[scene]);
    let edited = folder.read("box-room.portals.json").replace("\"glass\"", "\"west\"");
    std::fs::write(folder.path("box-room.portals.json"), &edited).unwrap();
    let refused = folder.try_run(&["portals", scene]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1));
    assert!(said.contains("--force") && said.lines().count() == 1, "{said}");
    assert_eq!(folder.read("box-room.portals.json"), edited);
    folder.portals(&[scene, "-o", "other.json"]);
    assert!(folder.path("other.portals.png").is_file());
    assert_eq!(folder.read("box-room.portals.json"), edited);
    folder.portals(&[scene, "--force"]);
    assert_eq!(folder.read("box-room.portals.json"), folder.read("other.json"));
}

#[test]
fn windows_apart_are_numbered() {
    let folder = Folder::new();
    let (listed, _) = folder.portals(&["chapel:bays=1,edge=1", "--group", "apart", "-o", "a.json"]);
    let (joined, _) = folder.portals(&["chapel:bays=1,edge=1", "-o", "j.json"]);
    assert!(listed.contains("glass 1 ") && listed.contains("glass_rose 1 "), "{listed}");
    let sum = |text: &str| text.lines().last().unwrap().split(", ").nth(1).unwrap().to_string();
    assert_eq!(sum(&listed), sum(&joined));
    assert!(joined.contains("3 portals"), "{joined}");
}

#[test]
fn bake_through_the_file_is_the_bake_by_name() {
    let folder = Folder::new();
    folder.room();
    let named = folder.lit("room.obj", &["--portal", "glass*"]);
    folder.portals(&["room.obj"]);
    let filed = folder.lit("room.obj", &[]);
    assert_eq!(named.position, filed.position);
    // The same pane cut into other triangles, so that other points of it are sampled: 1024 rays leave 1.2 % at each
    // vertex and 0.01 % in the mean.
    let (off, ratio) = difference(&named, &filed.total, &named.total);
    assert!(off < 0.03 && (ratio - 1.0).abs() < 0.002, "{off} {ratio}");
}

#[test]
fn refined_bake_is_continued_by_a_refined_bake() {
    let folder = Folder::new();
    let bake = |more: &[&str]| {
        let bake = ["bake", "box-room:edge=0.3", "--portal", "glass*", "--rays", "32", "--bounces", "1"];
        let basis = ["--basis", "haar,sh", "-o", "room.safetensors"];
        folder.try_run(&[&bake[..], &basis, more].concat())
    };
    let said = String::from_utf8(bake(&["--refine", "2", "--order", "2"]).stderr).unwrap();
    assert!(said.lines().any(|l| l.starts_with("refined: ") && l.contains(" vertices more")), "{said}");
    let more = ["--order", "3", "--continue", "room.safetensors"];
    assert!(!bake(&more).status.success(), "another mesh");
    assert!(bake(&[&more[..], &["--refine", "2"]].concat()).status.success());
}

/// As of a terminal that went away.
#[test]
fn bake_whose_messages_nobody_reads_is_finished() {
    let folder = Folder::new();
    folder.room();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lunette"));
    command.args(["bake", "room.obj", "--portal", "glass*", "--rays", "32", "--bounces", "0"]);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let status = command.current_dir(folder.0.path()).stderr(writer).status().unwrap();
    assert!(status.success() && folder.path("room.safetensors").exists(), "{status}");
}

#[test]
fn hole_lights_the_room_as_its_pane_did() {
    let folder = Folder::new();
    folder.room();
    let glass = folder.lit("room.obj", &["--portal", "glass*"]);
    let (listed, said) = folder.portals(&["hole.obj"]);
    assert!(listed.starts_with("opening") && !said.contains("elsewhere"), "{listed}{said}");
    let hole = folder.lit("hole.obj", &[]);
    assert_eq!(glass.position, hole.position);
    // The pane lets 0.9 of the light through, and the hole all of it.
    let paned = |light: &[[f32; 3]]| light.iter().map(|e| e.map(|x| 0.9 * x)).collect::<Vec<_>>();
    let hole = Lit { direct: paned(&hole.direct), total: paned(&hole.total), ..hole };
    // The portal is the reveal's outer end instead of its middle, with the same light through it: 1.3 % of sampling
    // noise, and 0.04 % in the mean.
    let (off, ratio) = difference(&glass, &hole.direct, &glass.direct);
    assert!(off < 0.03 && (ratio - 1.0).abs() < 0.005, "{off} {ratio}");
    // The outer half of the reveal sends light in by either: 0.1 % apart, the noise of bounced light.
    let (_, ratio) = difference(&glass, &hole.total, &glass.total);
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn light_that_enters_elsewhere_is_said_by_bake() {
    let folder = Folder::new();
    folder.room();
    let bake = ["bake", "--rays", "16", "--bounces", "0", "-o", "out.safetensors"];
    // A portal in the inner half of the window: the other half of its light enters elsewhere.
    let half = r#"{"format": "lunette-portals", "version": 1, "portals": [{"name": "half", "polygons":
        [[[-2.1, 1, -0.8], [-2.1, 1, 0], [-2.1, 2.2, 0], [-2.1, 2.2, -0.8]]]}]}"#;
    std::fs::write(folder.path("half.json"), half).unwrap();
    let (_, said) = folder.run(&[&bake[..], &["hole.obj", "--portals", "half.json"]].concat());
    let line = said.lines().find(|l| l.contains("elsewhere")).expect(&said);
    let share: f32 = line.split(" %").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
    // Under half: the walls see both halves alike, but the reveal, where much of the portal's light falls, sees more of
    // its own.
    assert!((30.0..50.0).contains(&share), "{line}");
    let (_, said) = folder.run(&[&bake[..], &["room.obj", "--portal", "glass"]].concat());
    assert!(!said.contains("elsewhere"), "{said}");
    let (_, said) = folder.run(&[&bake[..], &["room.obj"]].concat());
    assert!(said.contains("'glass'") && said.contains("blocks light"), "{said}");
}

#[test]
fn nearest_exterior_splits_and_warns_of_light_thrown_back() {
    let folder = Folder::new();
    let bake = [
        "bake",
        "box-room:edge=0.8",
        "--portal",
        "glass",
        "--rays",
        "16",
        "--bounces",
        "0",
        "--resolution",
        "8",
    ];
    let (_, near) = folder.run(&[&bake[..], &["--nearest-exterior", "2.5"]].concat());
    // 2 m across; 5 degrees at 2.5 m allow 0.44 m: 1.6 m is halved three times, 1.2 m two times. And of the sphere
    // 2.5 m away 1.92 m² is 1.92 / (4 π 2.5²) = 2.4 %.
    assert!(near.contains("2.00 m across") && near.contains("cut into 32"), "{near}");
    assert!(near.contains("2.4 % of its sphere"), "{near}");
    let (_, far) = folder.run(&[&bake[..], &["--nearest-exterior", "12"]].concat());
    assert!(!far.contains("cut into") && !far.contains("of its sphere"), "{far}");
}
