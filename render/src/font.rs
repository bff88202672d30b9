//! The digits of a legend: 5 x 7 pixels each.

use crate::image::Picture;

/// Rows of a glyph.
pub(crate) const GLYPH_HEIGHT: usize = 7;
/// Columns of a glyph.
const GLYPH_WIDTH: usize = 5;

/// Rows from the top, the leftmost column in bit 4.
#[rustfmt::skip]
const GLYPHS: [(char, [u8; GLYPH_HEIGHT]); 12] = [
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110]),
    ('2', [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111]),
    ('3', [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110]),
    ('4', [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110]),
    ('6', [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110]),
    ('7', [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000]),
    ('8', [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110]),
    ('9', [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100]),
    ('.', [0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b01100, 0b01100]),
    ('%', [0b11000, 0b11001, 0b00010, 0b00100, 0b01000, 0b10011, 0b00011]),
];

/// Width of a text in pixels; one empty column between glyphs.
pub(crate) fn width(text: &str) -> usize {
    (text.chars().count() * (GLYPH_WIDTH + 1)).saturating_sub(1)
}

/// Draws text with its upper left corner at (x, y). What is outside the picture, and characters that are neither
/// digit, point nor percent sign, are left out.
pub(crate) fn draw(picture: &mut Picture, x: usize, y: usize, text: &str, colour: [u8; 3]) {
    for (i, c) in text.chars().enumerate() {
        let Some((_, rows)) = GLYPHS.iter().find(|(glyph, _)| *glyph == c) else { continue };
        for (row, bits) in rows.iter().enumerate() {
            for column in (0..GLYPH_WIDTH).filter(|k| bits >> (GLYPH_WIDTH - 1 - k) & 1 == 1) {
                let (px, py) = (x + i * (GLYPH_WIDTH + 1) + column, y + row);
                if px < picture.width && py < picture.height {
                    picture.pixels[py * picture.width + px] = colour;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glyphs_are_drawn_inside_and_differ() {
        let drawn = GLYPHS.map(|(c, _)| {
            let mut picture = Picture { width: 5, height: 7, pixels: vec![[0; 3]; 35] };
            draw(&mut picture, 0, 0, &c.to_string(), [1; 3]);
            assert!(picture.pixels.contains(&[1; 3]));
            picture
        });
        assert!((0..12).all(|i| (0..i).all(|j| drawn[i] != drawn[j])));
        assert_eq!(width("10%"), 17);
    }

    #[test]
    fn text_over_the_edge_is_cut() {
        let mut picture = Picture { width: 7, height: 5, pixels: vec![[0; 3]; 35] };
        draw(&mut picture, 3, 2, "88x", [1; 3]);
        assert_eq!(picture.pixels.len(), 35);
        assert!(picture.pixels.contains(&[1; 3]));
    }
}
