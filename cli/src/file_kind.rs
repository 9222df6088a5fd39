//! Detection of file kinds by extension and content.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Kinds of input files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileKind {
    /// A URDF file, or a file of unknown kind that the URDF reader rejects.
    Urdf,
    /// A MuJoCo model in XML.
    Mjcf,
    /// A scene file: TOML, YAML or JSON.
    Scene,
    /// Another kind: its name with an article, and a hint on how to use it.
    Other(&'static str, &'static str),
}

/// Extensions of files without a model, with the kind of file and a hint on how to use it.
const OTHER_EXTENSIONS: [(&[&str], &str, &str); 7] = [
    (&["png", "jpg", "jpeg", "gif", "apng", "webp", "bmp", "tga", "tif", "tiff", "ppm"], "an image", ""),
    (&["mp4", "avi", "mov", "mkv", "webm"], "a video", ""),
    (&["stl", "obj", "dae", "glb", "gltf", "ply", "msh"], "a mesh", "; name it in a URDF or MJCF file"),
    (&["mcap", "npz"], "a recording", "; kinetoscope replay shows it, kinetoscope plot lists it"),
    (&["xacro"], "a xacro file", "; expand it first: xacro FILE > robot.urdf"),
    (&["sdf", "world"], "an SDF file", ""),
    (&["usd", "usda", "usdc", "usdz"], "a USD file", ""),
];

/// Signatures of binary files, with the kind of file.
const SIGNATURES: [(&[u8], &str); 6] = [
    (b"\x89PNG", "an image"),
    (b"\xff\xd8\xff", "an image"),
    (b"GIF8", "an image"),
    (b"\x89MCAP", "a recording"),
    (b"PK\x03\x04", "an archive"),
    (b"\x7fELF", "a program"),
];

impl FileKind {
    /// Returns the kind of a file. For an unreadable file, the kind follows from its name, and its reader reports the
    /// error.
    pub(crate) fn of(path: &Path) -> Self {
        if path.is_dir() {
            return Self::Other("a folder", "");
        }
        let end = path.extension().map(|end| end.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let begins = first_bytes(path);
        if let Some((_, what)) = SIGNATURES.iter().find(|(begins_with, _)| begins.starts_with(begins_with)) {
            return Self::Other(what, "");
        }
        let by_name = match end.as_str() {
            "toml" | "yaml" | "yml" | "json" => Self::Scene,
            "xml" | "mjcf" => Self::Mjcf,
            end => {
                let other = OTHER_EXTENSIONS.iter().find(|(ends, ..)| ends.contains(&end));
                other.map_or(Self::Urdf, |(_, what, hint)| Self::Other(what, hint))
            }
        };
        // The root element takes precedence over the extension.
        match (by_name, root_element(&String::from_utf8_lossy(&begins))) {
            (Self::Urdf | Self::Mjcf, Some("robot")) => Self::Urdf,
            (Self::Urdf | Self::Mjcf, Some("mujoco")) => Self::Mjcf,
            (Self::Urdf | Self::Mjcf, Some("mujocoinclude")) => {
                Self::Other("a part of an MJCF file", "; give the file that includes it")
            }
            (Self::Urdf | Self::Mjcf, Some("sdf")) => Self::Other("an SDF file", ""),
            (kind, _) => kind,
        }
    }
}

/// Returns the first 64 KiB of a file, fewer bytes if it is shorter, and none if it cannot be read.
fn first_bytes(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Ok(file) = File::open(path) {
        // Errors are ignored: the reader of the file reports them.
        let _ = file.take(1 << 16).read_to_end(&mut bytes);
    }
    bytes
}

/// Returns the name of the root element of an XML text, or `None` if the text does not start with an element.
fn root_element(text: &str) -> Option<&str> {
    let mut rest = text.trim_start_matches('\u{feff}').trim_start();
    loop {
        let after = match rest {
            _ if rest.starts_with("<?") => rest.split_once("?>")?.1,
            _ if rest.starts_with("<!--") => rest.split_once("-->")?.1,
            _ if rest.starts_with("<!") => rest.split_once('>')?.1,
            _ => break,
        };
        rest = after.trim_start();
    }
    let name = rest.strip_prefix('<')?;
    Some(&name[..name.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?])
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn kinds() {
        let folder = tempfile::tempdir().unwrap();
        let (robot, mujoco): (&[u8], &[u8]) =
            (b"<?xml version='1.0'?>\n<!-- a > b -->\n<robot name='r'/>", b"<mujoco/>");
        let image = FileKind::Other("an image", "");
        for (name, content, kind) in [
            ("a.urdf", robot, FileKind::Urdf),
            ("b.xml", mujoco, FileKind::Mjcf),
            ("c.xml", robot, FileKind::Urdf),
            ("d.urdf", mujoco, FileKind::Mjcf),
            ("e.urdf", b"no XML", FileKind::Urdf),
            ("f.xml", b"", FileKind::Mjcf),
            ("g.TOML", b"", FileKind::Scene),
            ("h.yml", b"a: 1", FileKind::Scene),
            ("i.json", b"{}", FileKind::Scene),
            ("j.png", b"", image),
            ("k.urdf", b"\x89PNG\r\n", image),
            ("l", robot, FileKind::Urdf),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            assert_eq!(FileKind::of(&path), kind, "{name}");
        }
        for (name, content, what) in [
            ("a.stl", b"solid".as_slice(), "mesh"),
            ("a.mcap", b"", "recording"),
            ("a.xacro", robot, "xacro"),
            ("a.xml", b"<mujocoinclude>", "part of an MJCF"),
            ("b.xml", b"\xef\xbb\xbf<!DOCTYPE sdf><sdf version='1.9'>", "SDF"),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            let FileKind::Other(found, _) = FileKind::of(&path) else { panic!("{name}: {:?}", FileKind::of(&path)) };
            assert!(found.contains(what), "{name}: {found}");
        }
        assert_eq!(FileKind::of(folder.path()), FileKind::Other("a folder", ""));
        assert_eq!(FileKind::of(&folder.path().join("missing.toml")), FileKind::Scene);
    }
}
