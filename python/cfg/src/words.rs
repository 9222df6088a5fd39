//! Conversion of Rust documentation to Python: replaces Rust names in code spans and wraps lines.

use crate::source::snake_case;

/// Rust names without a counterpart in Python, and their replacements.
const WORDS: &[(&str, &str)] = &[
    ("ActuatorState", "actuator state"),
    ("AutoresetMode", "mode of automatic resets"),
    ("Boxes", "``BoxesTerrain``"),
    ("Camera", "camera"),
    ("Camera::history", "``Sensor.history``"),
    ("Clip", "``\"clip\"``"),
    ("ContactSensor", "contact sensor"),
    ("DiscreteObstacles", "``DiscreteObstaclesTerrain``"),
    ("DriveCfg::default", "``DriveCfg()``"),
    ("EnvId", "Indices of environments"),
    ("FastRayTraced", "``\"fast_ray_traced\"``"),
    ("Format::LeRobot", "``\"lerobot\"``"),
    ("FoxgloveServer::url", "``FoxgloveServer.url``"),
    ("FrameTransformer", "frame transformer"),
    ("Gap", "``GapTerrain``"),
    ("IdealPd", "the actuator ``ideal_pd``"),
    ("IkSolver", "``Robot.compute_ik``"),
    ("Imu", "IMU"),
    ("JointState", "joint state"),
    ("JointWrench", "joint wrench"),
    ("LightingSpace::Display", "``\"display\"`` lighting"),
    ("Minimal", "``minimal``"),
    ("MujocoSensor", "sensor of type ``mujoco_sensor``"),
    ("Properties", "``SimulationManager.property``"),
    ("PyramidSlope", "``PyramidSlopeTerrain``"),
    ("PyramidStairs", "``PyramidStairsTerrain``"),
    ("RayCaster", "ray caster"),
    ("RayCasterCamera", "ray-caster camera"),
    ("RecordingSummary::left_out", "``RecordingSummary.left_out``"),
    ("Renderer::Hybrid", "``\"hybrid\"``"),
    ("Renderer::RAY_TRACED", "``CameraRenderer.ray_traced()``"),
    ("Renderer::Raster", "``\"raster\"``"),
    ("Renderer::RayTraced", "``\"ray_traced\"``"),
    ("ShotNoise::electrons", "``ShotNoise.electrons``"),
    ("Holes::max_angle", "``Holes.max_angle``"),
    ("SteppingStones", "``SteppingStonesTerrain``"),
    ("StereoCamera", "stereo camera"),
    ("TipFrame::at", "``link``"),
    ("TipFrame::with_tcp", "the argument ``tcp``"),
    ("Topic::Everything", "``Topic.everything()``"),
    ("Topic::Overview", "``Topic.overview()``"),
    ("Waves", "``WavesTerrain``"),
    ("crate::DriveType", "``DriveType``"),
    ("f32", "single precision"),
    ("ground: None", "``ground=None``"),
    ("kinetoscope_scene::terrain", "``TerrainGenerator``"),
    ("kinetoscope_sim::SimulationManagerCfg::env_origins", "``SimulationManager.env_origins``"),
    ("stiffness: 100.0.into()", "``stiffness=100.0``"),
];

/// Phrases about items that Python does not have, and their replacements. Spaces stand for any white space.
const PHRASES: &[(&str, &str)] = &[
    (" (``Sensor::markers``)", ""),
    (" (``SensorCfg::lazy``)", ""),
    (" (``TipFrame::of_part``)", ""),
    (" (``Lens::is_forward``)", ""),
    ("(``SensorCfg::debug_vis``)", "(``debug_vis``)"),
    ("``Default`` is ", "The default is "),
    ("``Default`` has ", "The default has "),
    (", see ``kinetoscope_scene::shape::RenderMesh::levels``;", ";"),
    ("For an ``IkSolver``, one for each variable of its chain. ", ""),
    ("in scene files, ``equidistant`` is ``Equidistant``, which has no coefficients.", "here, it has no coefficients."),
    (
        "is the error ``RandomizationError::NoSizeProperty``, which suggests alternatives",
        "is an error that suggests alternatives",
    ),
    (": see ``super::RandomizationError``", ", which is an error"),
    (": see ``ISAAC``", ""),
    ("the part of ``RenderScene::ambient`` that", "the part of the light from all directions that"),
    (
        "is ``RenderScene::ambient``: its sky's radiance from above the horizon, its ground's from below.",
        "comes from all directions: the sky's radiance from above the horizon, the ground's from below.",
    ),
    ("Cameras and mirrors see ``RenderScene::sky`` instead.", "Cameras and mirrors see the sky instead."),
    ("the seed and ``FrameSample::noise`` only", "the seed and the image only"),
    ("A factor outside ``FACTOR_RANGE`` is refused.", "It must be from 0.001 to 1000."),
    (" (``Format::all``)", ""),
    (" Requires the feature ``lerobot``.", ""),
    (" (``App::new``)", ""),
    ("``TermRegistry::names`` lists the types of a kind. ", ""),
    ("Some keys belong to the kind", "These keys belong to the kind"),
    (" (``ImageRenderer::exposure_compensation``)", ""),
    (
        "The default is ``DepthNoise::KHOSHELHAM``.",
        "The default is that of a Kinect (Khoshelham and Oude Elberink 2012).",
    ),
];

/// Replaces Rust names. `is_literal` returns true for an enumeration whose values are strings in Python, and `None` for
/// types that are no enumerations.
///
/// # Errors
/// A name has no counterpart.
pub(crate) fn in_python(doc: &str, is_literal: impl Fn(&str) -> Option<bool>) -> Result<String, String> {
    let mut text = String::new();
    for (at, paragraph) in doc.split("\n\n").enumerate() {
        if at > 0 {
            text.push_str("\n\n");
        }
        text.push_str(&replaced_phrases(paragraph));
    }
    let mut kept = String::new();
    // Odd parts are code.
    for (at, part) in text.split("``").enumerate() {
        if at % 2 == 0 {
            kept.push_str(part);
        } else {
            kept.push_str(&name(part, &is_literal)?);
        }
    }
    Ok(kept)
}

/// Replaces phrases that may extend over several lines.
fn replaced_phrases(paragraph: &str) -> String {
    let mut text = paragraph.to_string();
    for (phrase, replacement) in PHRASES {
        while let Some((start, end)) = find_phrase(&text, phrase) {
            text.replace_range(start..end, replacement);
        }
    }
    text
}

/// Byte range of the first match of `phrase`. A space in `phrase` matches one or more spaces and line breaks, or the
/// end of `text`.
fn find_phrase(text: &str, phrase: &str) -> Option<(usize, usize)> {
    let mut starts = text.char_indices().map(|(at, _)| at);
    starts.find_map(|start| Some((start, start + length_of_phrase(&text[start..], phrase)?)))
}

/// Length of a phrase at the start of a text.
fn length_of_phrase(text: &str, phrase: &str) -> Option<usize> {
    let mut rest = text;
    for letter in phrase.chars() {
        rest = if letter == ' ' {
            let trimmed = rest.trim_start_matches([' ', '\n']);
            if trimmed.len() == rest.len() && !rest.is_empty() {
                return None;
            }
            trimmed
        } else {
            rest.strip_prefix(letter)?
        };
    }
    Some(text.len() - rest.len())
}

/// A name in code, in the notation of Python.
fn name(code: &str, is_literal: &impl Fn(&str) -> Option<bool>) -> Result<String, String> {
    if let Some((_, word)) = WORDS.iter().find(|(known, _)| *known == code) {
        return Ok((*word).into());
    }
    // Functions of OpenCV have the same notation.
    let Some((owner, item)) = code.split_once("::").filter(|(owner, _)| *owner != "cv" && !code.ends_with("::")) else {
        return Ok(format!("``{code}``"));
    };
    match is_literal(owner) {
        Some(true) => return Ok(format!("``\"{}\"``", snake_case(item))),
        Some(false) => return Ok(format!("``{owner}.{}``", snake_case(item))),
        None => {}
    }
    if owner == "ContactSensor" || owner == "SensorCfg" {
        return Ok(format!("``{item}``"));
    }
    let class = owner.strip_suffix("Mut").unwrap_or(owner);
    if class.ends_with("Cfg") || ["Robot", "RigidObject", "Extrinsics", "SimulationManager"].contains(&class) {
        return Ok(format!("``{class}.{item}``"));
    }
    Err(format!("`{code}` has no counterpart in Python; add it to python/cfg/src/words.rs"))
}

/// Words of a paragraph or item, with the indentation of its first and further lines.
type Paragraph<'d> = (String, String, Vec<&'d str>);

/// Writes the lines of a paragraph.
fn close(open: &mut Option<Paragraph<'_>>, width: usize, lines: &mut Vec<String>) {
    let Some((mut line, further, words)) = open.take() else { return };
    let mut is_empty = true;
    for word in words {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, further.clone()));
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    lines.push(line);
}

/// Breaks the lines of a documentation, at most `width` long. Code and tables stay as they are.
pub(crate) fn wrapped(doc: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut open: Option<Paragraph<'_>> = None;
    for line in doc.lines() {
        let content = line.trim_start();
        let indentation = &line[..line.len() - content.len()];
        let is_item = content.starts_with("- ");
        if content.is_empty() || content.starts_with('|') || indentation.len() >= 4 {
            close(&mut open, width, &mut lines);
            lines.push(line.into());
        } else if is_item || open.is_none() {
            close(&mut open, width, &mut lines);
            let further = if is_item { format!("{indentation}  ") } else { indentation.to_string() };
            let first = if is_item { format!("{indentation}- ") } else { indentation.to_string() };
            let words = content.strip_prefix("- ").unwrap_or(content).split_whitespace().collect();
            open = Some((first, further, words));
        } else if let Some((_, _, words)) = &mut open {
            words.extend(content.split_whitespace());
        }
    }
    close(&mut open, width, &mut lines);
    lines
}
