//! Lamps, headlight and sky of MuJoCo models.

use crate::light_cfg::{LampKind, LightCfg};
use crate::mj::{Data, LightType, Model, TextureArrays, TextureType};
use kinetoscope_scene::material::decode_srgb;
use kinetoscope_scene::{Headlight, Hemisphere, Light, LightKind, LightSum, RenderScene, Sky};

/// The light of a scene besides its lamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// That of simulations: our headlight, ambient light and sky, unless a model has a skybox. Light is added up in linear
    /// light.
    Own,
    /// That of MuJoCo's renderer, for models that are drawn alone: nothing but the lamps and the headlight of the file, a black
    /// background without a skybox. Light is added up as numbers of the screen.
    Mujoco,
}

/// Sets the lamps, the headlight, the ambient light and the sky of `scene` to the model's.
pub(super) fn light(model: &Model, look: Look, scene: &mut RenderScene) {
    let linear = |color: [f32; 3]| if look == Look::Mujoco { color } else { linear(color) };
    scene.lights = (0..model.nlight())
        .map(|index| {
            let light = model.light(index);
            let spot = LightKind::Spot { cutoff_deg: light.cutoff_deg.min(90.0), exponent: light.exponent };
            let kind = match light.kind {
                LightType::Directional => LightKind::Directional,
                // OpenGL's spots of 180 degrees shine everywhere.
                LightType::Spot if light.cutoff_deg > 90.0 => LightKind::Point,
                LightType::Spot => spot,
                LightType::Point | LightType::Image => LightKind::Point,
            };
            Light {
                kind,
                position: [0.0; 3],
                direction: [0.0, 0.0, -1.0],
                ambient: linear(light.ambient),
                diffuse: linear(light.diffuse),
                specular: linear(light.specular),
                attenuation: light.attenuation,
                // That of a directional lamp is an angle here, a length there.
                radius: if kind == LightKind::Directional { 0.0 } else { light.radius.max(0.0) },
                cast_shadow: light.cast_shadow,
                // An image around everything is no lamp.
                active: light.active && light.kind != LightType::Image,
            }
        })
        .collect();
    match look {
        // Not the headlight that MuJoCo gives to models that ask for none: ours goes with our ambient light.
        Look::Own => scene.headlight = Headlight::default(),
        Look::Mujoco => {
            let headlight = model.headlight();
            scene.headlight = Headlight {
                ambient: headlight.ambient,
                diffuse: headlight.diffuse,
                specular: headlight.specular,
                active: headlight.active,
            };
            scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
            scene.sky = Sky::uniform([0.0; 3]);
            scene.light_sum = LightSum::Display;
        }
    }
    let skybox = (0..model.ntex()).filter_map(|t| model.texture(t)).find(|t| t.kind == TextureType::Skybox);
    if let Some(sky) = skybox.and_then(|texture| gradient(&texture)) {
        scene.sky = sky;
    }
}

/// MuJoCo multiplies colours as they are on the screen; ours are multiplied in linear light. For one light the result is
/// the same up to the small linear part of sRGB: (c l)^2.2 = c^2.2 l^2.2.
fn linear(color: [f32; 3]) -> [f32; 3] {
    color.map(decode_srgb)
}

/// Light of all domes together, linear; `None` without one.
pub(super) fn domes(lamps: &[LightCfg]) -> Option<[f32; 3]> {
    let domes = lamps.iter().filter_map(|lamp| match lamp.kind {
        LampKind::Dome { intensity } => Some(linear(lamp.color.map(|c| c as f32)).map(|c| c * intensity as f32)),
        _ => None,
    });
    domes.reduce(|sum, dome| std::array::from_fn(|k| sum[k] + dome[k]))
}

/// Where the lamps are in `data`.
pub(super) fn read(data: &Data, lamps: &[Light], out: &mut [Light]) {
    let (positions, directions) = (data.light_xpos().as_chunks::<3>().0, data.light_xdir().as_chunks::<3>().0);
    for (index, (to, lamp)) in out.iter_mut().zip(lamps).enumerate() {
        let position = positions[index].map(|x| x as f32);
        *to = Light { position, direction: directions[index].map(|x| x as f32), ..*lamp };
    }
}

/// True if a skybox has no more in it than a gradient over the elevation: all sides are alike, and each is its own mirror image.
pub(super) fn is_gradient(texture: &TextureArrays<'_>) -> bool {
    let (side, channels) = (texture.width, texture.channels);
    if channels < 3 || texture.height < 6 * side {
        let first = texture.pixels.get(..channels);
        return texture.pixels.chunks_exact(channels.max(1)).all(|pixel| Some(pixel) == first);
    }
    let pixel = |face: usize, row: usize, column: usize| {
        let at = ((face * side + row) * side + column) * channels;
        texture.pixels.get(at..at + channels)
    };
    // The numbers of builtin gradients are rounded in different ways on both sides.
    let alike = |a: Option<&[u8]>, b: Option<&[u8]>| {
        a.zip(b).is_some_and(|(a, b)| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 2))
    };
    (0..side * side).all(|k| {
        let (row, column) = (k / side, k % side);
        let one = pixel(0, row, column);
        alike(one, pixel(0, row, side - 1 - column)) && [1, 4, 5].iter().all(|f| alike(one, pixel(*f, row, column)))
    })
}

/// The gradient nearest to a skybox: the middle of its upper face, the horizon of its sides, the middle of its lower face.
/// (The image itself, clouds for instance, is not drawn.)
fn gradient(texture: &TextureArrays<'_>) -> Option<Sky> {
    let side = texture.width;
    // Faces one below the other: right, left, up, down, front, back.
    if side == 0 || texture.channels < 3 || texture.height < side {
        return None;
    }
    // A square is the same on all faces.
    let one = texture.height < 6 * side;
    let mean = |face: usize, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        let mut sum = [0.0f32; 3];
        let count = (rows.len() * columns.len()) as f32;
        for row in rows {
            for column in columns.clone() {
                let face = if one { 0 } else { face };
                let at = ((face * side + row) * side + column) * texture.channels;
                for (sum, byte) in sum.iter_mut().zip(&texture.pixels[at..at + 3]) {
                    *sum += f32::from(*byte) / 255.0;
                }
            }
        }
        sum.map(|s| s / count)
    };
    let middle = side / 2..side / 2 + 1;
    let horizon = [0, 1, 4, 5].map(|face| mean(face, middle.clone(), 0..side));
    let horizon = [0, 1, 2].map(|c| horizon.iter().map(|h| h[c]).sum::<f32>() / 4.0);
    Some(Sky { zenith: mean(2, middle.clone(), middle.clone()), horizon, nadir: mean(3, middle.clone(), middle) })
}
