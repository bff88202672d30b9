//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

/// Bake how a static scene answers to light once, then relight it with dot products.
#[derive(Parser)]
#[command(name = "lunette", version, max_term_width = 100)]
pub struct Arguments {
    /// Say nothing but results and errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Subcommand)]
pub enum Command {
    /// Bake and relight built-in scenes, with pictures and a short report
    Demo(Demo),
    /// Write a built-in scene as .obj, or list them
    Scene(Scene),
    /// Bake a scene's transfer into one file
    Bake(Bake),
    /// Find an interior's windows and holes, and write them as portals for bake
    Portals(Portals),
    /// Light a baked scene: a picture, or irradiance per vertex
    Relight(Relight),
    /// Path-trace the reference: a picture, or irradiance per vertex
    Render(Render),
    /// Hold methods against the reference: error, bytes, seconds, and a picture of each error
    Compare(Compare),
    /// Say what is in a baked file
    Info(Info),
}

/// `lunette demo`
#[derive(Args)]
pub struct Demo {
    /// Folder for pictures and report
    #[arg(default_value = "lunette-demo")]
    pub folder: PathBuf,
    /// Threads; 0 takes all cores
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    pub threads: usize,
}

/// `lunette scene`
#[derive(Args)]
pub struct Scene {
    /// NAME or NAME:key=value,...
    #[arg(required_unless_present = "list")]
    pub name: Option<String>,
    /// The .obj file; its .mtl is written beside it
    #[arg(short, long, required_unless_present = "list")]
    pub output: Option<PathBuf>,
    /// List the built-in scenes and their parameters
    #[arg(long)]
    pub list: bool,
}

/// How a scene is read.
#[derive(Args)]
pub struct SceneOptions {
    /// Axis that points up in the file: y or z (terrains know)
    #[arg(long, default_value = "y", value_parser = ["y", "z"])]
    pub up: String,
    /// Metres per unit of the file
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub scale: f32,
    /// Factor on the heights of a terrain
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub vertical_scale: f32,
    /// Normals are built smooth across edges flatter than this, in degrees
    #[arg(long, default_value_t = 40.0, allow_negative_numbers = true)]
    pub crease_angle: f32,
    /// Split triangles until no edge is longer than this, metres
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    pub subdivide: Option<f32>,
}

/// A number of SH bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bands {
    Auto,
    Fixed(usize),
}

impl std::str::FromStr for Bands {
    type Err = String;

    fn from_str(text: &str) -> Result<Bands, String> {
        match text {
            "auto" => Ok(Bands::Auto),
            _ => text.parse().map(Bands::Fixed).map_err(|_| "give a number from 1 to 10, or auto".into()),
        }
    }
}

/// How much work goes into a bake.
#[derive(Args)]
pub struct Effort {
    /// SH bands of direct light, 1 to 10; with portals, of bounced light, and `auto` takes as many as hold --energy
    #[arg(long, default_value = "5", allow_negative_numbers = true)]
    pub order: Bands,
    /// SH bands of bounced light, 1 to 10 [default: as --order]
    #[arg(long, allow_negative_numbers = true)]
    pub indirect_order: Option<usize>,
    /// Rays per vertex, 16 to 65536
    #[arg(long, default_value_t = 1024, allow_negative_numbers = true)]
    pub rays: usize,
    /// How often light bounces, 0 to 1000
    #[arg(long, default_value_t = 2, allow_negative_numbers = true)]
    pub bounces: usize,
    /// Texels on a side of a cubemap's face: 8, 16, 32 or 64
    #[arg(long, default_value_t = 32, allow_negative_numbers = true)]
    pub resolution: usize,
    /// Patches of direct-to-indirect transport
    #[arg(long, default_value_t = 4096, allow_negative_numbers = true)]
    pub patches: usize,
    /// Most links of sixteen neighbouring vertices in direct-to-indirect transport
    #[arg(long, default_value_t = 448, allow_negative_numbers = true)]
    pub links: usize,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads; 0 takes all cores
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    pub threads: usize,
}

/// `lunette bake`
#[derive(Args)]
pub struct Bake {
    /// .obj, .ply, a terrain (.asc .dem .hgt .png .tif), or the name of a built-in scene
    pub scene: String,
    /// The baked file [default: the scene's name with .safetensors]
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Go on from this baked file: keep what is there, add bands of --order or photons of --photons
    #[arg(long = "continue", value_name = "FILE")]
    pub earlier: Option<PathBuf>,
    /// What to store, of bent, aperture, sh, haar (direct light on a cubemap), direct-to-indirect (bounced light)
    /// [default: bent,aperture,sh; with portals haar,sh,direct-to-indirect]
    #[arg(long, value_delimiter = ',')]
    pub basis: Vec<String>,
    #[command(flatten)]
    pub effort: Effort,
    #[command(flatten)]
    pub portals: PortalChoice,
    #[command(flatten)]
    pub read: SceneOptions,
}

/// Through what light enters an interior.
#[derive(Args, Default)]
#[command(next_help_heading = "Interiors")]
pub struct Openings {
    /// Material or group names of the glass, like 'glass*'; may be given several times
    #[arg(long, value_name = "GLOB")]
    pub portal: Vec<String>,
    /// A portal file [default: SCENE.portals.json, where there is one]
    #[arg(long, value_name = "FILE", conflicts_with = "portal")]
    pub portals: Option<PathBuf>,
    /// Take the scene as it is, glass and all, though there is a portal file
    #[arg(long)]
    pub no_portals: bool,
    /// Split portals too large for exterior objects at this distance, metres
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    pub nearest_exterior: Option<f32>,
}

/// How light that enters an interior is carried on.
#[derive(Args)]
#[command(next_help_heading = "Interiors")]
pub struct PortalChoice {
    #[command(flatten)]
    pub openings: Openings,
    /// Start bounced SH light from this many photons per portal, instead of gathering it from the direct light
    #[arg(long, value_name = "N")]
    pub photons: Option<u64>,
    /// Share of the energy of bounced SH light that --order auto holds, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 95.0, allow_negative_numbers = true)]
    pub energy: f64,
    /// Halve edges of the mesh, so many times, where the shadow of something near by ends: 0..=6
    #[arg(long, value_name = "TIMES", default_value_t = 0, allow_negative_numbers = true)]
    pub refine: usize,
}

/// `lunette portals`
#[derive(Args)]
pub struct Portals {
    /// A scene, as for bake
    pub scene: String,
    /// The portal file, replaced if there is one; the picture lies beside it [default: SCENE.portals.json, where bake
    /// looks for it]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace the default portal file, which may have been edited by hand
    #[arg(long)]
    pub force: bool,
    /// Size of the picture in pixels, for its two views side by side
    #[arg(long, value_name = "WxH", default_value = "1600x700")]
    pub size: String,
    /// What shares a portal and its shell of outside light: joined, one for each glass and one for all plain holes
    /// (everything outside is far away), or apart, one for each window
    #[arg(long, default_value = "joined", value_parser = ["joined", "apart"])]
    pub group: String,
    /// Cells of the search grid, 1000 to 20000000: a hole narrower than a cell may be missed; time and memory grow with
    /// them [default: cells of 0.15 m, but 300000 to 1000000 of them]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub cells: Option<usize>,
    /// Leave out holes of less than this, m²: cracks
    #[arg(long, value_name = "M2", default_value_t = 0.01, allow_negative_numbers = true)]
    pub smallest_area: f32,
    /// Holes with bars of up to this width between them are one window, metres; 0 joins none
    #[arg(long, value_name = "METRES", default_value_t = 0.2, allow_negative_numbers = true)]
    pub widest_bar: f32,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads; 0 takes all cores
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    pub threads: usize,
    #[command(flatten)]
    pub read: SceneOptions,
}

/// What shines.
#[derive(Args)]
pub struct LightOptions {
    /// uniform, uniform:r,g,b, cie-overcast, cap:x,y,z,radius,radiance, sky:azimuth,elevation,turbidity,
    /// point:..., spot:..., an .exr or .hdr picture; several joined by ' + '
    #[arg(long, value_name = "SPEC", required_unless_present = "day", allow_hyphen_values = true)]
    pub light: Option<String>,
    /// Turn the light about the vertical, degrees clockwise seen from above
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub turn: f32,
    /// A date, 2026-06-21: one frame per step through its 24 hours under the sun and sky of --at
    #[arg(long, value_name = "DATE", requires = "at")]
    pub day: Option<String>,
    /// Latitude and longitude, degrees, north and east positive
    #[arg(long, value_name = "LAT,LON", requires = "day", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Frames of a day
    #[arg(long, default_value_t = 24, allow_negative_numbers = true)]
    pub frames: usize,
    /// Haze of a day's sky, 1 (clear) to 10
    #[arg(long, default_value_t = 3.0, allow_negative_numbers = true)]
    pub turbidity: f32,
}

/// What a picture looks like.
#[derive(Args)]
pub struct PictureOptions {
    /// eye;target;fov as x,y,z;x,y,z;degrees [default: frames the scene]
    #[arg(long, value_name = "EYE;TARGET;FOV", allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "960x600")]
    pub size: String,
    /// Stops: radiance times 2^EV [default: from the picture]
    #[arg(long, value_name = "EV", allow_negative_numbers = true)]
    pub exposure: Option<f32>,
}

/// `lunette relight`
#[derive(Args)]
pub struct Relight {
    /// A baked file
    pub file: PathBuf,
    #[command(flatten)]
    pub light: LightOptions,
    /// .png or .exr: a picture; .safetensors or .ply: irradiance per vertex; %02d counts the frames of a day
    #[arg(short, long, default_value = "relit.png")]
    pub output: PathBuf,
    /// bent, aperture, aperture-smooth, haar, sh, or shN for N bands; -lanczos after sh damps ringing
    /// [default: haar where baked, else sh, else aperture, else bent]
    #[arg(long)]
    pub method: Option<String>,
    #[command(flatten)]
    pub picture: PictureOptions,
    #[command(flatten)]
    pub outside: Outside,
    #[command(flatten)]
    pub moving: Moving,
}

/// What is not in the bake: lamps, and bodies that cast shadows.
#[derive(Args)]
#[command(next_help_heading = "Lamps and things that move")]
pub struct Moving {
    /// A ball of light: x,y,z,radius,L in metres, L one radiance or r,g,b; x,y,z:x,y,z,radius,L moves in --frames steps;
    /// may be given several times
    #[arg(long, value_name = "X,Y,Z[:X,Y,Z],RADIUS,L", allow_hyphen_values = true)]
    pub lamp: Vec<String>,
    /// A body that shadows lamps and suns: a scene as for bake, and where its origin stands, turned clockwise by TURN
    /// degrees; a second place moves it in --frames steps; may be given several times
    #[arg(long, value_name = "SCENE[@X,Y,Z[,TURN[,SCALE]][:X,Y,Z[,TURN]]]", allow_hyphen_values = true)]
    pub blocker: Vec<String>,
    /// Spheres that stand for a blocker, 1 to 4096
    #[arg(long, default_value_t = 64, allow_negative_numbers = true)]
    pub spheres: usize,
    /// Levels of the masks before lamps, 1 to 5
    #[arg(long, default_value_t = 5, allow_negative_numbers = true)]
    pub mask_depth: u32,
    /// What a partly hidden cell of a mask is: lit (aggressive), dark (conservative), or as dark as it is hidden
    #[arg(long, default_value = "proportional", value_parser = ["aggressive", "conservative", "proportional"])]
    pub mask: String,
    /// Products of lobes below this share of a lamp's solid angle are dropped, or taken without a lobe
    #[arg(long, default_value_t = 0.001, allow_negative_numbers = true)]
    pub threshold: f32,
    /// A .png of the products of lobes per vertex in false colour
    #[arg(long, value_name = "FILE")]
    pub products: Option<PathBuf>,
}

/// What is outside of an interior, and how its light bounces.
#[derive(Args, Default)]
#[command(next_help_heading = "Interiors")]
pub struct Outside {
    /// Glass of a portal: NAME=tint:r,g,b | frosted:radians | closed | clear, joined by +; may be given several times
    #[arg(long, value_name = "NAME=GLASS")]
    pub portal_material: Vec<String>,
    /// An object outside, seen through the portals: a scene, as for bake
    #[arg(long, value_name = "SCENE")]
    pub exterior: Option<String>,
    /// Where the object moves, in --frames steps: x,y,z:x,y,z, metres
    #[arg(long, value_name = "FROM:TO", requires = "exterior", allow_hyphen_values = true)]
    pub along: Option<String>,
    /// How bounced light is carried: sh, direct-to-indirect or none [default: direct-to-indirect where the light has a
    /// sun and it is baked, else sh]
    #[arg(long)]
    pub indirect: Option<String>,
}

/// `lunette render`
#[derive(Args)]
pub struct Render {
    /// A scene, as for bake
    pub scene: String,
    #[command(flatten)]
    pub light: LightOptions,
    /// .png or .exr: a picture; .safetensors or .ply: irradiance per vertex
    #[arg(short, long, default_value = "reference.png")]
    pub output: PathBuf,
    /// Paths per pixel or vertex
    #[arg(long, default_value_t = 256, allow_negative_numbers = true)]
    pub samples: u32,
    /// How often light bounces
    #[arg(long, default_value_t = 8, allow_negative_numbers = true)]
    pub bounces: u32,
    /// Seed
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u32,
    #[command(flatten)]
    pub openings: Openings,
    #[command(flatten)]
    pub picture: PictureOptions,
    #[command(flatten)]
    pub read: SceneOptions,
}

/// `lunette compare`
#[derive(Args)]
pub struct Compare {
    /// A scene, as for bake
    pub scene: String,
    #[command(flatten)]
    pub light: LightOptions,
    /// Methods as for relight, comma-separated; of an interior also portal, portal-sh1 to portal-sh10 and portal-d2i,
    /// by what carries its bounced light [default: bent,aperture,sh3,sh5,sh10; of an interior
    /// sh5,sh10,portal-sh4,portal-d2i]
    #[arg(long, value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Folder for the table and the pictures
    #[arg(short, long, default_value = "compare")]
    pub output: PathBuf,
    /// Paths per judged point of the reference
    #[arg(long, default_value_t = 1024, allow_negative_numbers = true)]
    pub samples: u32,
    /// Paths per pixel of the reference picture
    #[arg(long, default_value_t = 64, allow_negative_numbers = true)]
    pub picture_samples: u32,
    /// Judge in the middle of one of so many triangles
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub every: usize,
    #[command(flatten)]
    pub effort: Effort,
    #[command(flatten)]
    pub portals: PortalChoice,
    #[command(flatten)]
    pub picture: PictureOptions,
    #[command(flatten)]
    pub read: SceneOptions,
}

/// `lunette info`
#[derive(Args)]
pub struct Info {
    /// A baked file
    pub file: PathBuf,
}
