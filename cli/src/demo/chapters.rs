//! What the demo shows.

/// The day whose hours are shown, and the place: Mount St Helens.
pub const DATE: &str = "2026-06-21";
pub const PLACE: &str = "46.2,-122.2";

/// One scene: some pictures of it relit, some lights under which all methods are judged.
pub struct Chapter {
    pub title: &'static str,
    pub scene: &'static str,
    pub kind: Kind,
    /// As for `--camera`; by itself where not given.
    pub camera: Option<&'static str>,
    /// Rays per vertex of the bake.
    pub rays: usize,
    /// What to look for.
    pub text: &'static str,
    pub shots: &'static [Shot],
    pub trials: &'static [Trial],
}

impl Chapter {
    /// The scene's name without its parameters, for files.
    pub fn name(&self) -> &'static str {
        self.scene.split(':').next().unwrap_or_default()
    }
}

/// Where light comes from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The sky all around.
    OpenSky,
    /// Through the panes of glass alone.
    Interior,
}

/// A picture.
pub enum Shot {
    /// Sun and sky at an hour of the day, mean solar time; inside there is one method, of no name.
    Hour { hour: usize, method: Option<&'static str> },
    /// A light as on the command line.
    Spec { spec: &'static str, method: Option<&'static str> },
    /// A light and other glass, as for `--portal-material`; all of these are exposed as the first.
    Glass { spec: &'static str, glass: &'static [&'static str] },
    /// A light and what goes by outside: a frame of a drive through the town.
    Drive { spec: &'static str, frame: usize },
}

/// What goes by outside, as for `--exterior` and `--along`, and in how many frames.
pub const DRIVE: (&str, &str, usize) = ("town", "0,0,-30:0,0,30", 3);

impl Shot {
    pub fn method(&self) -> Option<&'static str> {
        match self {
            Shot::Hour { method, .. } | Shot::Spec { method, .. } => *method,
            Shot::Glass { .. } | Shot::Drive { .. } => None,
        }
    }
}

/// A light under which all methods are held against the reference.
pub struct Trial {
    pub light: &'static str,
    /// Judged in the middle of one of so many triangles.
    pub stride: usize,
    /// Paths per judged point: its noise should stay five times under the errors.
    pub samples: u32,
    /// Paths per vertex of the reference's picture, where there are pictures.
    pub pictures: Option<u32>,
}

const fn hour(hour: usize) -> Shot {
    Shot::Hour { hour, method: Some("aperture") }
}

const fn hour_inside(hour: usize) -> Shot {
    Shot::Hour { hour, method: None }
}

const fn overcast() -> Shot {
    Shot::Spec { spec: "cie-overcast", method: Some("sh10") }
}

/// The sun opposite the rose.
const fn glass(glass: &'static [&'static str]) -> Shot {
    Shot::Glass { spec: "sky:185,42", glass }
}

const fn drive(frame: usize) -> Shot {
    Shot::Drive { spec: "sky:165,40 + cap:0,-1,0,1.57,1.5", frame }
}

pub const CHAPTERS: [Chapter; 9] = [
    Chapter {
        title: "Mountains through a day",
        scene: "terrain",
        kind: Kind::OpenSky,
        camera: Some("-3100,300,-2500;0,330,0;42"),
        rays: 512,
        text: "One bake, then only dot products: the sun and sky of five hours of a midsummer day, and an overcast \
               sky. The sun is drawn by the aperture, which gives it a sharp shadow at any size; the overcast sky by \
               spherical harmonics of ten bands, which hold so smooth a light.",
        shots: &[hour(6), hour(8), hour(12), hour(16), hour(18), overcast()],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 4096, pictures: None },
            Trial { light: "sky:265,32", stride: 64, samples: 1024, pictures: None },
        ],
    },
    Chapter {
        title: "A courtyard through a day",
        scene: "courtyard:edge=0.4,columns=3",
        kind: Kind::OpenSky,
        camera: None,
        rays: 512,
        text: "Coloured walls send their colour on: light that has bounced twice is baked as spherical harmonics of \
               order 3 for every method. Where the arcades leave a vertex several separate pieces of sky, one cap \
               cannot stand for them, and the aperture's shadows are only plausible. The walls outside and the \
               underside look under the horizon, where an overcast sky is dark: the aperture, which fills its hole \
               with one colour, lights them all the same, and most of its error under that sky is there.",
        shots: &[hour(8), hour(10), hour(12), hour(15), overcast()],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 4096, pictures: None },
            Trial { light: "sky:150,50", stride: 64, samples: 1024, pictures: None },
        ],
    },
    Chapter {
        title: "A post on a plane, and a wide lamp",
        scene: "cylinder-on-plane:edge=0.2",
        kind: Kind::OpenSky,
        camera: None,
        rays: 2048,
        text: "The didactic scene of the aperture paper: beside the post one half of the sky is hidden, and what is \
               left is not a disc. A lamp of 0.3 radians is wide enough for ten bands.",
        shots: &[],
        trials: &[Trial { light: "cap:-1,0.8,-0.4,0.3,1", stride: 1, samples: 512, pictures: Some(512) }],
    },
    Chapter {
        title: "Where the aperture fails: a band at the horizon",
        scene: "horizon-band:edge=0.5",
        kind: Kind::OpenSky,
        camera: Some("5.5,0.9,0;-1,0,0;70"),
        rays: 2048,
        text: "Under the canopy only a ring of sky at the horizon is visible. Its mean direction is straight up, \
               where the canopy is: the aperture opens right through it, and the lamp overhead shines through the \
               roof. Spherical harmonics know the canopy; in its shade one sees the ripples that even ten bands leave.",
        shots: &[],
        trials: &[Trial { light: "cap:0,1,0,0.5,1", stride: 1, samples: 1024, pictures: Some(1024) }],
    },
    Chapter {
        title: "Where spherical harmonics fail: a small sun",
        scene: "sphere-on-plane",
        kind: Kind::OpenSky,
        camera: None,
        rays: 2048,
        text: "A sun of 0.005 radians, as large as the real one. Its shadow has an edge that ten bands cannot hold: \
               it is washed out, with ripples around it and negative light (shown black) within. The Lanczos window \
               removes the ripples and blurs the shadow further. The aperture keeps an edge, of the wrong shape.",
        shots: &[],
        trials: &[Trial {
            light: "cap:-0.8,0.6,-0.2,0.005,10000",
            stride: 1,
            samples: 256,
            pictures: Some(256),
        }],
    },
    Chapter {
        title: "A chapel through a day",
        scene: "chapel:bays=2,edge=0.5",
        kind: Kind::Interior,
        camera: Some("1.9,1.45,3.6;-0.9,2.0,-4;72"),
        rays: 512,
        text: "A closed room, lit through its windows alone. Each kind of glass is a portal: what it lets through is \
               baked on a cubemap of its own, and the sky's picture there is made anew for every frame. The sun's \
               spots move over floor and walls; what they send on lights the vault, carried from direct to \
               indirect light, since low bands of spherical harmonics would blur the sun before it has bounced. The \
               last four pictures are one hour with the rose behind the camera red as it was modelled, clear, \
               frosted and closed: the same bake. It breaks in the ripples on the vault, which few rays leave, and in the glow at the foot of walls \
               and columns, where one patch spans light and shadow. Windows are drawn as holes.",
        shots: &[
            hour_inside(7),
            hour_inside(9),
            hour_inside(12),
            hour_inside(15),
            hour_inside(17),
            Shot::Spec { spec: "cie-overcast", method: None },
            glass(&[]),
            glass(&["glass_rose=clear"]),
            glass(&["glass_rose=tint:0.75,0.28,0.18+frosted:0.3"]),
            glass(&["glass_rose=closed"]),
        ],
        trials: &[],
    },
    Chapter {
        title: "A car driven through a town",
        scene: "car:edge=0.2",
        kind: Kind::Interior,
        camera: Some("0.1,1.3,1.0;-0.1,0.55,-0.6;75"),
        rays: 64,
        text: "The interior is baked once and stays where it is; the town moves past, is drawn into the portals' \
               cubemaps every frame, and shades and colours the seats. Only the light of what is outside is \
               computed: the windows are drawn without the town.",
        shots: &[drive(0), drive(1), drive(2)],
        trials: &[],
    },
    Chapter {
        title: "A box with a small skylight: portals against plain spherical harmonics",
        scene: "skylight-box:edge=0.25",
        kind: Kind::Interior,
        camera: None,
        rays: 512,
        text: "The interior paper's second figure. To plain precomputed radiance transfer (sh5, sh10) the opening is \
               a small part of the whole sky, and ten bands over the sphere cannot hold its edge: direct light is \
               smeared over the room, under an overcast sky as under a sun. A portal's rows hold it texel by texel, and \
               a sun by the outline of the opening itself. \
               What has bounced is smooth: four bands per portal (portal-sh4) carry an overcast sky's, but not a \
               sun's, which they blur before it enters; direct-to-indirect (portal-d2i) carries both, in more bytes, \
               and spreads within a patch what lights a part of it. The reference here is found at the vertices, which are \
               darkest in the creases.",
        shots: &[],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 8192, pictures: None },
            Trial { light: "sky:120,60", stride: 8, samples: 2048, pictures: Some(128) },
        ],
    },
    Chapter {
        title: "A room with a window",
        scene: "box-room:edge=0.25",
        kind: Kind::Interior,
        camera: None,
        rays: 512,
        text: "A larger opening, seen from most of the room: plain spherical harmonics come nearer under the overcast \
               sky, and fail under the sun as before.",
        shots: &[],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 8192, pictures: None },
            Trial { light: "sky:275,25", stride: 16, samples: 2048, pictures: None },
        ],
    },
];
