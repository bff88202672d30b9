//! Polygon meshes in `.ply` files: ASCII, or binary of either byte order.
//!
//! Taken over: `x y z`, `nx ny nz`, faces of any number of corners (`vertex_indices` or `vertex_index`) and Stanford's
//! `tristrips`. Vertex colours (`red green blue`, with or without `diffuse_`) become one albedo, their mean in linear
//! light: whole numbers are sRGB, floating-point ones are linear already. Texture is detail that a material per mesh
//! cannot hold; the mean keeps the light that bounces right on the whole.
//!
//! Elements are read one by one, so that a header that promises more than the file holds costs nothing.
//!
//! Based on: Turk, The PLY Polygon File Format, 1994.

use std::io::{BufRead, Cursor, ErrorKind};
use std::path::Path;

use glam::Vec3;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};

use crate::names::count;
use crate::open::{self, DEFAULT, LoadOptions};
use crate::polygon::triangulate;
use crate::repair::{Soup, finish};
use crate::scene::{Error, Material, Scene};

/// Loads a `.ply` file.
pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Scene, Error> {
    let bytes = open::read(path)?;
    let at = path.display().to_string();
    let mut file = open_file(&bytes, &at)?;
    let content = read_content(&mut file)?;
    if content.arity.is_empty() {
        let n = count(content.position.len(), "vertex");
        return Err(
            file.invalid(format!("no triangle: the file has {n} and no face; is it a cloud of points?"))
        );
    }
    let mut scene = Scene { groups: vec![DEFAULT.into()], ..Scene::default() };
    scene.materials.push(Material { name: DEFAULT.into(), albedo: albedo(&content), ..Material::default() });
    scene.report.push(if content.n_coloured > 0 {
        "vertex colours replaced by their mean".into()
    } else {
        "no materials: made grey (Kd 0.5)".to_owned()
    });
    let soup = gather(content, &file)?;
    finish(soup, scene, options, &at)
}

/// A file whose header is read.
struct File<'a> {
    at: &'a str,
    header: Header,
    payload: Cursor<&'a [u8]>,
    /// Lines read so far; of use in ASCII files only.
    line: usize,
}

impl File<'_> {
    fn invalid(&self, what: String) -> Error {
        Error::Invalid { at: self.at.to_owned(), what }
    }

    /// An error in the element read last.
    fn invalid_element(&self, def: &ElementDef, i: usize, what: &str) -> Error {
        match self.header.encoding {
            Encoding::Ascii => {
                Error::Invalid { at: format!("{}:{}", self.at, self.line), what: what.to_owned() }
            }
            _ => Error::Invalid { at: format!("{}: {} {i}", self.at, def.name), what: what.to_owned() },
        }
    }
}

fn open_file<'a>(bytes: &'a [u8], at: &'a str) -> Result<File<'a>, Error> {
    let invalid = |at: String, what: &str| Error::Invalid { at, what: what.to_owned() };
    if !bytes.starts_with(b"ply") {
        return Err(invalid(at.to_owned(), "not a PLY file (it does not begin with 'ply')"));
    }
    let (text, payload) = split_header(bytes)
        .ok_or_else(|| invalid(at.to_owned(), "the header has no end (end_header); cut short?"))?;
    let mut reader = Reader::new(text.as_bytes());
    let header =
        Parser::<Vertex>::new().read_header(&mut reader).map_err(|error: ParseError| match error.line() {
            Some(line) => {
                let wrong = text.lines().nth(line - 1).unwrap_or_default();
                invalid(format!("{at}:{line}"), &format!("'{wrong:.60}' is not understood in a PLY header"))
            }
            None => invalid(at.to_owned(), "the PLY header has no valid format line"),
        })?;
    Ok(File { at, header, payload: Cursor::new(payload), line: text.lines().count() })
}

/// The header with plain line ends, its comments blanked (they may be in any encoding), and what follows it.
fn split_header(bytes: &[u8]) -> Option<(String, &[u8])> {
    // The first line shows how all end; in binary data behind the header, a line feed may be a number.
    let first = bytes.iter().position(|&b| b == b'\r' || b == b'\n')?;
    let end: &[u8] = match (bytes[first], bytes.get(first + 1)) {
        (b'\r', Some(b'\n')) => b"\r\n",
        (b'\r', _) => b"\r",
        _ => b"\n",
    };
    let mut text = String::new();
    let mut rest = bytes;
    loop {
        let length = rest.windows(end.len()).position(|w| w == end).unwrap_or(rest.len());
        let line = String::from_utf8_lossy(&rest[..length]);
        let line = line.trim();
        rest = rest.get(length + end.len()..).unwrap_or_default();
        let is_comment = line.is_empty() || line.starts_with("comment") || line.starts_with("obj_info");
        text += if is_comment { "comment" } else { line };
        text.push('\n');
        if line == "end_header" {
            return Some((text, rest));
        }
        if rest.is_empty() {
            return None;
        }
    }
}

/// What the elements hold.
#[derive(Default)]
struct Content {
    position: Vec<Vec3>,
    /// Zero where there is none.
    normal: Vec<Vec3>,
    /// Corners of all faces, one face after the other.
    corner: Vec<u32>,
    /// Corners of each face.
    arity: Vec<u32>,
    /// Sum over vertices, linear.
    colour: glam::DVec3,
    n_coloured: usize,
}

fn read_content(file: &mut File) -> Result<Content, Error> {
    let mut content = Content::default();
    for def in file.header.elements.clone().values() {
        match def.name.as_str() {
            "vertex" => {
                if ["x", "y", "z"].iter().any(|&axis| !def.properties.contains_key(axis)) {
                    return Err(file.invalid("its vertices have no x, y and z".into()));
                }
                read_elements(file, def, |vertex: Vertex| add_vertex(&mut content, vertex))?;
            }
            "face" => read_elements(file, def, |face: Face| add_face(&mut content, face.corners()?))?,
            "tristrips" => {
                read_elements(file, def, |strip: Face| add_strips(&mut content, &strip.corners()?))?
            }
            _ => read_elements(file, def, |_: Skipped| Ok(()))?,
        }
    }
    Ok(content)
}

/// Reads all elements of one kind, and hands each to `take`, which says what is wrong with it.
fn read_elements<E: PropertyAccess>(
    file: &mut File,
    def: &ElementDef,
    mut take: impl FnMut(E) -> Result<(), String>,
) -> Result<(), Error> {
    if def.properties.is_empty() {
        return Ok(());
    }
    let cut_short =
        |i: usize| format!("the file ends after {i} of {}; it is cut short", count(def.count, &def.name));
    let left = file.payload.get_ref().len() - file.payload.position() as usize;
    // Every element takes a byte at least.
    if def.count > left {
        return Err(
            file.invalid(format!("{} do not fit in the file; it is cut short", count(def.count, &def.name)))
        );
    }
    for i in 0..def.count {
        let element = read_element::<E>(file, def).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => file.invalid(cut_short(i)),
            _ => file.invalid_element(def, i, &format!("not the {} that the header describes", def.name)),
        })?;
        take(element).map_err(|what| file.invalid_element(def, i, &what))?;
    }
    Ok(())
}

fn read_element<E: PropertyAccess>(file: &mut File, def: &ElementDef) -> Result<E, ParseError> {
    let parser = Parser::<E>::new();
    match file.header.encoding {
        Encoding::BinaryLittleEndian => parser.read_little_endian_element(&mut file.payload, def),
        Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut file.payload, def),
        Encoding::Ascii => {
            let mut line = String::new();
            while line.trim().is_empty() {
                line.clear();
                file.line += 1;
                if file.payload.read_line(&mut line)? == 0 {
                    return Err(std::io::Error::from(ErrorKind::UnexpectedEof).into());
                }
            }
            parser.read_ascii_element(&line, def)
        }
    }
}

fn add_vertex(content: &mut Content, vertex: Vertex) -> Result<(), String> {
    if !vertex.position.is_finite() {
        return Err("a coordinate of the vertex is not finite".into());
    }
    if content.position.len() >= u32::MAX as usize {
        return Err("more than 4294967295 vertices".into());
    }
    content.position.push(vertex.position);
    content.normal.push(vertex.normal);
    if vertex.colour.is_finite() && vertex.has_colour {
        content.colour += vertex.colour.clamp(Vec3::ZERO, Vec3::ONE).as_dvec3();
        content.n_coloured += 1;
    }
    Ok(())
}

fn add_face(content: &mut Content, corners: Vec<i64>) -> Result<(), String> {
    for &index in &corners {
        content.corner.push(to_index(index)?);
    }
    content.arity.push(corners.len() as u32);
    Ok(())
}

/// Strips of triangles, each sharing an edge with the last; a negative index starts a new strip.
fn add_strips(content: &mut Content, corners: &[i64]) -> Result<(), String> {
    for strip in corners.split(|&index| index < 0) {
        for (i, corner) in strip.windows(3).enumerate() {
            let [a, b, c] = [corner[0], corner[1], corner[2]];
            // Every other triangle is wound the other way; a corner that comes twice only turns the strip around.
            if a != b && b != c && c != a {
                add_face(content, if i % 2 == 0 { vec![a, b, c] } else { vec![b, a, c] })?;
            }
        }
    }
    Ok(())
}

fn to_index(index: i64) -> Result<u32, String> {
    u32::try_from(index).map_err(|_| format!("the face names vertex {index}"))
}

fn albedo(content: &Content) -> Vec3 {
    match content.n_coloured {
        0 => Material::default().albedo,
        n => (content.colour / n as f64).as_vec3(),
    }
}

fn gather(content: Content, file: &File) -> Result<Soup, Error> {
    let n = content.position.len();
    let mut soup = Soup { position: content.position, ..Soup::default() };
    let (mut start, mut corner, mut triangles) = (0, Vec::new(), Vec::new());
    for (i, &arity) in content.arity.iter().enumerate() {
        let ring = &content.corner[start..start + arity as usize];
        start += arity as usize;
        if let Some(&index) = ring.iter().find(|&&index| index as usize >= n) {
            return Err(
                file.invalid(format!("face {i} names vertex {index}, and there are {n}, counted from 0"))
            );
        }
        corner.clear();
        corner.extend(ring.iter().map(|&v| soup.position[v as usize]));
        triangulate(&corner, &mut triangles);
        for triangle in &triangles {
            let triangle = triangle.map(|k| ring[k]);
            soup.triangle.push(triangle);
            soup.normal.push(triangle.map(|v| content.normal[v as usize]));
        }
    }
    soup.material = vec![0; soup.triangle.len()];
    soup.group = vec![0; soup.triangle.len()];
    Ok(soup)
}

struct Vertex {
    position: Vec3,
    normal: Vec3,
    /// Linear.
    colour: Vec3,
    has_colour: bool,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Vertex { position: Vec3::ZERO, normal: Vec3::ZERO, colour: Vec3::ZERO, has_colour: false }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            _ => return self.set_colour(name, &property),
        };
        match property.to_f32_lossy() {
            Some(value) => *place = value,
            None => return PropertyAccessResult::UnsupportedType,
        }
        PropertyAccessResult::Set
    }
}

impl Vertex {
    fn set_colour(&mut self, name: &str, property: &Property) -> PropertyAccessResult {
        let place = match name.strip_prefix("diffuse_").unwrap_or(name) {
            "red" => &mut self.colour.x,
            "green" => &mut self.colour.y,
            "blue" => &mut self.colour.z,
            _ => return PropertyAccessResult::Ignored,
        };
        *place = match *property {
            Property::UChar(value) => srgb_to_linear(f32::from(value) / 255.0),
            Property::UShort(value) => srgb_to_linear(f32::from(value) / 65535.0),
            Property::Float(value) => value,
            Property::Double(value) => value as f32,
            _ => return PropertyAccessResult::Ignored,
        };
        self.has_colour = true;
        PropertyAccessResult::Set
    }
}

/// IEC 61966-2-1.
fn srgb_to_linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// A face or a bundle of strips.
struct Face {
    corners: Option<Property>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Face { corners: None }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        self.corners = Some(property);
        PropertyAccessResult::Set
    }
}

impl Face {
    fn corners(self) -> Result<Vec<i64>, String> {
        match self.corners {
            Some(Property::ListChar(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(Property::ListUChar(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(Property::ListShort(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(Property::ListUShort(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(Property::ListInt(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(Property::ListUInt(list)) => Ok(list.into_iter().map(i64::from).collect()),
            Some(_) => Err("the vertex indices of a face have to be a list of whole numbers".into()),
            None => Err("a face without a list of vertex_indices".into()),
        }
    }
}

/// An element of no interest.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Skipped
    }
}
