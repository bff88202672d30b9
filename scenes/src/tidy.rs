//! `.obj` text made fit for `tobj`, one line at a time.
//!
//! `tobj` is handed only plain `v`, `vn`, `o` and `f` lines: blanks and comments are gone, indices are positive and
//! in range, faces have three or more corners that all have a normal or all have none, and everything that it would
//! misread (a tab after `usemtl`, too few numbers) never reaches it. What it has no place for travels in what it
//! has: the number of a vertex as its colour, group and material in the name of the object.

use std::io::{self, BufRead, Read, Write};

use crate::lines::{Lines, lines, name, number, words};
use crate::names::Names;

/// A line that cannot be mended.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Line number, from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

/// The stream that `tobj` reads, and what was seen on the way.
pub(crate) struct Tidy<'a> {
    source: Lines<'a>,
    /// Number of the line handed out last.
    pub line: usize,
    pub fault: Option<Fault>,
    pub n_vertices: u32,
    pub n_normals: u32,
    pub n_faces: usize,
    /// Points, lines and faces with fewer than three corners.
    pub n_loose: usize,
    /// Curves and free-form surfaces.
    pub n_curved: usize,
    pub groups: Names,
    /// Names after `usemtl`.
    pub materials: Names,
    /// What stood after `mtllib`.
    pub libraries: Vec<String>,
    current: Part,
    handed_out: Option<Part>,
    face: Vec<Corner>,
    out: Vec<u8>,
    read: usize,
}

/// What a face belongs to; `tobj` gets a new object where it changes.
#[derive(Clone, Copy, PartialEq)]
struct Part {
    group: Option<u32>,
    material: Option<u32>,
    has_normals: bool,
}

#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    normal: Option<u32>,
}

/// Starts tidying a file.
pub(crate) fn tidy(bytes: &[u8]) -> Tidy<'_> {
    Tidy {
        source: lines(bytes),
        line: 0,
        fault: None,
        n_vertices: 0,
        n_normals: 0,
        n_faces: 0,
        n_loose: 0,
        n_curved: 0,
        groups: Names::default(),
        materials: Names::default(),
        libraries: Vec::new(),
        current: Part { group: None, material: None, has_normals: false },
        handed_out: None,
        face: Vec::new(),
        out: Vec::new(),
        read: 0,
    }
}

/// Vertex number from the colour that carried it.
pub(crate) fn vertex_of(colour: &[f32]) -> u32 {
    (colour[1] as u32) << 16 | colour[0] as u32
}

/// Group and material from the name of the object that carried them.
pub(crate) fn part_of(object: &str) -> (Option<u32>, Option<u32>) {
    let mut parts = object.split(' ').map(|word| word.parse().ok());
    (parts.next().flatten(), parts.next().flatten())
}

impl Tidy<'_> {
    fn take(&mut self, line: &[u8]) -> Result<(), String> {
        let mut words = words(line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(words),
            b"vn" => self.normal(words),
            b"f" | b"fo" => self.face(words),
            b"l" | b"p" => {
                self.n_loose += 1;
                Ok(())
            }
            b"curv" | b"curv2" | b"surf" => {
                self.n_curved += 1;
                Ok(())
            }
            b"o" | b"g" => {
                self.current.group = named(&mut self.groups, name(line, keyword));
                Ok(())
            }
            b"usemtl" => {
                self.current.material = named(&mut self.materials, name(line, keyword));
                Ok(())
            }
            b"mtllib" => {
                self.libraries.push(name(line, keyword));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn vertex<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), String> {
        self.out.extend_from_slice(b"v");
        let mut n = 0;
        for word in words.take(3) {
            let value = number(word).ok_or_else(|| format!("'{}' is not a number", show(word)))?;
            if !value.is_finite() {
                return Err(format!("the coordinate '{}' is not finite", show(word)));
            }
            self.out.push(b' ');
            self.out.extend_from_slice(word);
            n += 1;
        }
        if n < 3 {
            return Err(format!("a vertex needs three coordinates, this one has {n}"));
        }
        let index = self.n_vertices;
        self.n_vertices = index.checked_add(1).ok_or("more than 4294967295 vertices")?;
        write(&mut self.out, format_args!(" {} {} 0\n", index & 0xFFFF, index >> 16));
        Ok(())
    }

    /// A normal that is not three numbers (`-1.#IND`) becomes zero, which is mended later.
    fn normal<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), String> {
        let start = self.out.len();
        self.out.extend_from_slice(b"vn");
        let mut n = 0;
        for word in words.take(3).filter(|word| number(word).is_some()) {
            self.out.push(b' ');
            self.out.extend_from_slice(word);
            n += 1;
        }
        if n < 3 {
            self.out.truncate(start);
            self.out.extend_from_slice(b"vn 0 0 0");
        }
        self.out.push(b'\n');
        self.n_normals = self.n_normals.checked_add(1).ok_or("more than 4294967295 normals")?;
        Ok(())
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), String> {
        self.face.clear();
        for word in words {
            let corner = self.corner(word)?;
            self.face.push(corner);
        }
        if self.face.len() < 3 {
            self.n_loose += 1;
            return Ok(());
        }
        self.n_faces += 1;
        self.current.has_normals = self.face.iter().all(|corner| corner.normal.is_some());
        self.write_part();
        self.write_face();
        Ok(())
    }

    fn corner(&self, word: &[u8]) -> Result<Corner, String> {
        let mut index = word.split(|&b| b == b'/');
        let read = |digits: Option<&[u8]>| match digits {
            None | Some(b"") => Ok(None),
            Some(digits) => parse_index(digits).map(Some).ok_or_else(|| not_a_corner(word)),
        };
        let (vertex, _texture, normal) = (read(index.next())?, index.next(), read(index.next())?);
        let vertex = vertex.ok_or_else(|| not_a_corner(word))?;
        Ok(Corner {
            vertex: resolve(vertex, self.n_vertices, "vertex")?,
            normal: normal.map(|n| resolve(n, self.n_normals, "normal")).transpose()?,
        })
    }

    fn write_part(&mut self) {
        let part = self.current;
        if self.handed_out.replace(part) != Some(part) {
            let show = |id: Option<u32>| id.map_or("-".to_owned(), |id| id.to_string());
            write(&mut self.out, format_args!("o {} {}\n", show(part.group), show(part.material)));
        }
    }

    fn write_face(&mut self) {
        self.out.push(b'f');
        for corner in &self.face {
            match corner.normal.filter(|_| self.current.has_normals) {
                Some(normal) => write(&mut self.out, format_args!(" {}//{normal}", corner.vertex)),
                None => write(&mut self.out, format_args!(" {}", corner.vertex)),
            }
        }
        self.out.push(b'\n');
    }
}

impl BufRead for Tidy<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        while self.read == self.out.len() && self.fault.is_none() {
            self.read = 0;
            self.out.clear();
            let Some((number, line)) = self.source.next() else { break };
            self.line = number;
            if let Err(what) = self.take(&line) {
                self.fault = Some(Fault { line: number, what });
                self.out.clear();
            }
        }
        Ok(&self.out[self.read..])
    }

    fn consume(&mut self, n: usize) {
        self.read += n;
    }
}

impl Read for Tidy<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(buffer)?;
        self.consume(n);
        Ok(n)
    }
}

fn named(names: &mut Names, name: String) -> Option<u32> {
    (!name.is_empty()).then(|| names.index(&name))
}

fn write(out: &mut Vec<u8>, text: std::fmt::Arguments<'_>) {
    out.write_fmt(text).expect("writing to memory does not fail");
}

fn parse_index(digits: &[u8]) -> Option<i64> {
    std::str::from_utf8(digits).ok()?.parse().ok()
}

/// Index from 1 of an index that may count backwards from the last one so far.
fn resolve(index: i64, n: u32, kind: &str) -> Result<u32, String> {
    let n = i64::from(n);
    let from_one = if index < 0 { index + n + 1 } else { index };
    u32::try_from(from_one)
        .ok()
        .filter(|_| (1..=n).contains(&from_one))
        .ok_or_else(|| format!("the face names {kind} {index}, and there are {n} before it"))
}

fn not_a_corner(word: &[u8]) -> String {
    format!("'{}' is not a corner of a face (vertex/texture/normal)", show(word))
}

/// A word for a message: printable and short.
fn show(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(word);
    let short: String = text.chars().take(24).map(|c| if c.is_control() { '?' } else { c }).collect();
    if text.chars().count() > 24 { short + "..." } else { short }
}
