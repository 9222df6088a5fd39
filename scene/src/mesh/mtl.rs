//! Materials of OBJ files.

use std::path::Path;

use super::error::{ReadContext, beside};
use super::{MeshError, MeshMaterial, TextureSource};

/// Options of `map_Kd`, with the largest number of words after each. After the first word, only numbers count.
const MAP_OPTIONS: [(&str, usize); 12] = [
    ("-s", 3),
    ("-o", 3),
    ("-t", 3),
    ("-mm", 2),
    ("-bm", 1),
    ("-boost", 1),
    ("-texres", 1),
    ("-blendu", 1),
    ("-blendv", 1),
    ("-clamp", 1),
    ("-cc", 1),
    ("-imfchan", 1),
];

/// Reads an MTL file that lies next to an OBJ: `Kd`, `d`, `Tr` and `map_Kd`. Numbers are clamped to 0..=1.
///
/// `Kd` multiplies the texture, as the format specifies, unless `Kd` is exactly black. Exporters write black to refer
/// to the texture.
pub(super) fn read(path: &Path, ctx: &ReadContext<'_>, bytes: &[u8]) -> Result<Vec<MeshMaterial>, MeshError> {
    let ctx = ReadContext { path, options: ctx.options };
    let text = String::from_utf8_lossy(bytes);
    let mut materials: Vec<MeshMaterial> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let at = || format!("line {}", index + 1);
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if word == "newmtl" {
            materials.push(MeshMaterial { name: rest.to_owned(), rgba: [1.0; 4], texture: None });
            continue;
        }
        let Some(material) = materials.last_mut() else { continue };
        match word {
            // Spectral and CIE XYZ colors are ignored; they do not occur in practice.
            "Kd" if !rest.starts_with("spectral") && !rest.starts_with("xyz") => {
                let values = numbers(&ctx, rest, &at)?;
                match values[..] {
                    [grey] => material.rgba[..3].fill(grey),
                    [r, g, b, ..] => material.rgba[..3].copy_from_slice(&[r, g, b]),
                    _ => return Err(ctx.invalid(at(), "Kd needs one or three numbers")),
                }
            }
            "d" => {
                let values = numbers(&ctx, rest.trim_start_matches("-halo"), &at)?;
                material.rgba[3] = *values.first().ok_or_else(|| ctx.invalid(at(), "d needs a number"))?;
            }
            "Tr" => {
                let values = numbers(&ctx, rest, &at)?;
                material.rgba[3] = 1.0 - values.first().ok_or_else(|| ctx.invalid(at(), "Tr needs a number"))?;
            }
            "map_Kd" | "map_kd" => {
                let name = without_options(rest);
                if name.is_empty() {
                    return Err(ctx.invalid(at(), "map_Kd has no file name"));
                }
                material.texture = Some(TextureSource::File(beside(path, name)));
            }
            _ => {}
        }
    }
    for material in &mut materials {
        if material.texture.is_some() && material.rgba[..3] == [0.0; 3] {
            material.rgba[..3].fill(1.0);
        }
    }
    Ok(materials)
}

fn numbers(ctx: &ReadContext<'_>, words: &str, at: &dyn Fn() -> String) -> Result<Vec<f32>, MeshError> {
    let number = |word: &str| match word.parse::<f32>() {
        Ok(x) if x.is_finite() => Ok(x.clamp(0.0, 1.0)),
        _ => Err(ctx.invalid(at(), format!("{word:?} is not a number in 0..=1"))),
    };
    words.split_whitespace().take_while(|w| !w.starts_with('#')).map(number).collect()
}

/// File name after the options. Names may contain spaces.
fn without_options(mut rest: &str) -> &str {
    let cut = |s: &str| s.find(char::is_whitespace).unwrap_or(s.len());
    while rest.starts_with('-') {
        let word = &rest[..cut(rest)];
        let Some((_, count)) = MAP_OPTIONS.iter().find(|(name, _)| *name == word) else { break };
        rest = rest[word.len()..].trim_start();
        for i in 0..*count {
            let word = &rest[..cut(rest)];
            if i > 0 && word.parse::<f32>().is_err() {
                break;
            }
            rest = rest[word.len()..].trim_start();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::MeshOptions;

    fn parse(text: &str) -> Result<Vec<MeshMaterial>, MeshError> {
        let path = Path::new("meshes/arm.mtl");
        read(path, &ReadContext { path, options: &MeshOptions::default() }, text.as_bytes())
    }

    #[test]
    fn materials() {
        let text = "# made by hand\nnewmtl light grey\nKd 0.5 .25 1\nd 0.5\nnewmtl b\r\nTr 0.25\nKd 0 0 0\n\
                    map_Kd -s 2 2 -clamp on tex\\my image.png\r\nnewmtl c\nKd 2 0 0\nillum 2\n";
        let materials = parse(text).unwrap();
        assert_eq!(materials[0].name, "light grey");
        assert_eq!(materials[0].rgba, [0.5, 0.25, 1.0, 0.5]);
        assert_eq!(materials[1].rgba, [1.0, 1.0, 1.0, 0.75]);
        assert_eq!(materials[1].texture, Some(TextureSource::File("meshes/tex/my image.png".into())));
        assert_eq!(materials[2].rgba, [1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn errors() {
        let error = parse("newmtl a\nKd 1 x 0").unwrap_err().to_string();
        assert_eq!(error, "meshes/arm.mtl: line 2: \"x\" is not a number in 0..=1");
        assert!(parse("newmtl a\nKd 1 1").is_err());
        assert!(parse("newmtl a\nmap_Kd -clamp on").is_err());
    }
}
