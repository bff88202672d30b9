//! What the demo shows.

/// The day whose hours are shown, and the place: Mount St Helens.
pub const DATE: &str = "2026-06-21";
pub const PLACE: &str = "46.2,-122.2";

/// One scene: some pictures of it relit, some lights under which all methods are judged.
pub struct Chapter {
    pub title: &'static str,
    pub scene: &'static str,
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

/// A picture.
pub enum Shot {
    /// Sun and sky at an hour of the day, mean solar time.
    Hour { hour: usize, method: &'static str },
    /// A light as on the command line.
    Spec { spec: &'static str, method: &'static str },
}

impl Shot {
    pub fn method(&self) -> &'static str {
        match self {
            Shot::Hour { method, .. } | Shot::Spec { method, .. } => method,
        }
    }
}

/// A light under which all methods are held against the reference.
pub struct Trial {
    pub light: &'static str,
    /// Every how many vertices; with 1 there are pictures too.
    pub stride: usize,
    /// Paths per vertex: its noise should stay five times under the errors.
    pub samples: u32,
}

const fn hour(hour: usize) -> Shot {
    Shot::Hour { hour, method: "aperture" }
}

pub const CHAPTERS: [Chapter; 5] = [
    Chapter {
        title: "Mountains through a day",
        scene: "terrain",
        camera: Some("-3100,300,-2500;0,330,0;42"),
        rays: 512,
        text: "One bake, then only dot products: the sun and sky of five hours of a midsummer day, and an overcast \
               sky. The sun is drawn by the aperture, which gives it a sharp shadow at any size; the overcast sky by \
               spherical harmonics of ten bands, which hold so smooth a light.",
        shots: &[
            hour(6),
            hour(8),
            hour(12),
            hour(16),
            hour(18),
            Shot::Spec { spec: "cie-overcast", method: "sh10" },
        ],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 4096 },
            Trial { light: "sky:265,32", stride: 64, samples: 1024 },
        ],
    },
    Chapter {
        title: "A courtyard through a day",
        scene: "courtyard:edge=0.4,columns=3",
        camera: None,
        rays: 512,
        text: "Coloured walls send their colour on: light that has bounced twice is baked as spherical harmonics of \
               order 3 for every method. Where the arcades leave a vertex several separate pieces of sky, one cap \
               cannot stand for them, and the aperture's shadows are only plausible. The walls outside and the \
               underside look under the horizon, where an overcast sky is dark: the aperture, which fills its hole \
               with one colour, lights them all the same, and most of its error under that sky is there.",
        shots: &[hour(8), hour(10), hour(12), hour(15), Shot::Spec { spec: "cie-overcast", method: "sh10" }],
        trials: &[
            Trial { light: "cie-overcast", stride: 64, samples: 4096 },
            Trial { light: "sky:150,50", stride: 64, samples: 1024 },
        ],
    },
    Chapter {
        title: "A post on a plane, and a wide lamp",
        scene: "cylinder-on-plane:edge=0.2",
        camera: None,
        rays: 2048,
        text: "The didactic scene of the aperture paper: beside the post one half of the sky is hidden, and what is \
               left is not a disc. A lamp of 0.3 radians is wide enough for ten bands.",
        shots: &[],
        trials: &[Trial { light: "cap:-1,0.8,-0.4,0.3,1", stride: 1, samples: 512 }],
    },
    Chapter {
        title: "Where the aperture fails: a band at the horizon",
        scene: "horizon-band:edge=0.5",
        camera: Some("5.5,0.9,0;-1,0,0;70"),
        rays: 2048,
        text: "Under the canopy only a ring of sky at the horizon is visible. Its mean direction is straight up, \
               where the canopy is: the aperture opens right through it, and the lamp overhead shines through the \
               roof. Spherical harmonics know the canopy; in its shade one sees the ripples that even ten bands leave.",
        shots: &[],
        trials: &[Trial { light: "cap:0,1,0,0.5,1", stride: 1, samples: 1024 }],
    },
    Chapter {
        title: "Where spherical harmonics fail: a small sun",
        scene: "sphere-on-plane",
        camera: None,
        rays: 2048,
        text: "A sun of 0.005 radians, as large as the real one. Its shadow has an edge that ten bands cannot hold: \
               it is washed out, with ripples around it and negative light (shown black) within. The Lanczos window \
               removes the ripples and blurs the shadow further. The aperture keeps an edge, of the wrong shape.",
        shots: &[],
        trials: &[Trial { light: "cap:-0.8,0.6,-0.2,0.005,10000", stride: 1, samples: 256 }],
    },
];
