//! Windows against ringing: a bright small source, cut off at order n, leaves ripples around it and negative
//! light behind it; scaling band l of the *light's* coefficients by w_l < 1 trades them for blur.
//!
//! Windowing keeps the DC coefficient, hence the light's total energy. It is not for smooth skies, which do
//! not ring, and it darkens the core of a sun's light noticeably: the exact direct light of a small source is
//! not a thing that low-order SH can give.
//!
//! Based on: Sloan, Stupid Spherical Harmonics (SH) Tricks, 2008.

use std::f32::consts::PI;

/// Which window, and how strong: 0 leaves everything as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Window {
    /// w_l = (sin x / x)^strength, x = π l / n. Strength 1 is Lanczos' own; up to about 3.
    Lanczos {
        /// The exponent, at least 0.
        strength: f32,
    },
    /// w_l = 1 / (1 + strength l² (l+1)²): minimises squared error + strength × squared Laplacian of the
    /// result. Useful from 0.0005 (order 9) to 0.05 (order 3).
    Laplacian {
        /// The weight of the Laplacian, at least 0.
        strength: f32,
    },
}

/// The factor of band `l` at `order`.
pub fn factor(order: usize, window: Window, l: usize) -> f32 {
    match window {
        Window::Lanczos { .. } if l == 0 => 1.0,
        Window::Lanczos { strength } => {
            let x = PI * l as f32 / order as f32;
            (x.sin() / x).powf(strength)
        }
        Window::Laplacian { strength } => {
            let eigenvalue = (l * (l + 1)) as f32;
            1.0 / (1.0 + strength * eigenvalue * eigenvalue)
        }
    }
}

/// Scales the bands of a light's order² SH `coefficients` in place.
///
/// # Panics
/// When there are fewer than order² coefficients.
pub fn window(order: usize, window: Window, coefficients: &mut [[f32; 3]]) {
    for l in 0..order {
        let w = factor(order, window, l);
        for coefficient in &mut coefficients[l * l..(l + 1) * (l + 1)] {
            *coefficient = coefficient.map(|c| w * c);
        }
    }
}
