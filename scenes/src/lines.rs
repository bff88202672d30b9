//! Lines of a text file as exporters really leave them.
//!
//! Line ends may be `\n`, `\r\n` or a lone `\r`; a `\` before the line end joins the next line; a byte-order
//! mark and stray NUL bytes are blanks. Text is handled as bytes, since names in old files are in any encoding.

use std::borrow::Cow;

/// Iterator over logical lines: (number of the first physical line, counted from 1; its bytes without the end).
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

/// Logical lines of `bytes`.
pub(crate) fn lines(bytes: &[u8]) -> Lines<'_> {
    Lines { rest: bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), number: 0 }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let first = self.physical()?;
        let number = self.number;
        let Some(head) = continued(first) else { return Some((number, Cow::Borrowed(first))) };
        let mut joined = head.to_vec();
        while let Some(next) = self.physical() {
            joined.push(b' ');
            let Some(head) = continued(next) else {
                joined.extend_from_slice(next);
                break;
            };
            joined.extend_from_slice(head);
        }
        Some((number, Cow::Owned(joined)))
    }
}

impl<'a> Lines<'a> {
    fn physical(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = rest.strip_prefix(b"\r\n").unwrap_or(rest.get(1..).unwrap_or_default());
        Some(line)
    }
}

/// What stands before the `\` at the end of a line, if there is one.
fn continued(line: &[u8]) -> Option<&[u8]> {
    line.trim_ascii_end().strip_suffix(b"\\")
}

/// Words of a line up to a comment (a word that begins with `#`).
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&b| b.is_ascii_whitespace() || b == 0)
        .filter(|word| !word.is_empty())
        .take_while(|word| word[0] != b'#')
}

/// The name after the keyword: the rest of the line with its inner blanks, less a comment that is set off by
/// blanks on both sides (`wood #3` is a name, `wood # oak` is `wood`).
pub(crate) fn name(line: &[u8], keyword: &[u8]) -> String {
    let start =
        line.windows(keyword.len()).position(|w| w == keyword).map_or(line.len(), |i| i + keyword.len());
    let text = String::from_utf8_lossy(&line[start..]).replace(|c: char| c.is_control(), " ");
    let text = text.trim_end().strip_suffix(" #").unwrap_or(&text);
    text.split(" # ").next().unwrap_or_default().trim().to_owned()
}

/// A word as a number; `None` if it is none. Infinite and NaN are numbers here.
pub(crate) fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(usize, String)> {
        lines(text.as_bytes()).map(|(n, l)| (n, String::from_utf8_lossy(&l).into_owned())).collect()
    }

    #[test]
    fn line_ends_of_three_systems_count_alike() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["a", "", "b"].join(end);
            assert_eq!(all(&text), [(1, "a".into()), (2, "".into()), (3, "b".into())], "{end:?}");
        }
    }

    #[test]
    fn continued_line_keeps_its_first_number() {
        assert_eq!(all("f 1 \\\r\n2 \\ \n3\nx"), [(1, "f 1  2  3".into()), (4, "x".into())]);
        assert_eq!(all("f 1 \\"), [(1, "f 1 ".into())]);
    }

    #[test]
    fn byte_order_mark_and_nul_are_blanks() {
        let (_, line) = lines(b"\xEF\xBB\xBFv 1\0 2 #3").next().unwrap();
        assert_eq!(words(&line).collect::<Vec<_>>(), [&b"v"[..], b"1", b"2"]);
    }

    #[test]
    fn name_keeps_blanks_and_loses_comment() {
        assert_eq!(name(b"\tusemtl  dark  oak #3 \t", b"usemtl"), "dark  oak #3");
        assert_eq!(name(b"usemtl wood # oak", b"usemtl"), "wood");
        assert_eq!(name(b"g #", b"g"), "");
        assert_eq!(name(b"g", b"g"), "");
    }
}
