//! COLLADA tests with small documents of known content.

use std::path::Path;

use super::*;
use crate::mesh::tests_robots::faces_up;
use crate::mesh::{MeshOptions, TextureSource, load_bytes};

fn parse(text: &str, dae_up_axis: DaeUpAxis) -> Result<TriMesh, MeshError> {
    load_bytes(Path::new("meshes/part.dae"), text.as_bytes(), &MeshOptions { dae_up_axis })
}

/// A document whose vertices are 0 at the origin, 1 at +x, 2 at +y and 3 at +x +y, with the normal +z.
pub(crate) fn document(asset: &str, library: &str, primitive: &str, nodes: &str) -> String {
    format!(
        r##"<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset>{asset}</asset>
  {library}
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 0 1 0 1 1 0</float_array>
      <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
    <source id="n"><float_array id="na" count="3">0 0 1</float_array>
      <technique_common><accessor source="#na" count="1" stride="3"/></technique_common></source>
    <source id="t"><float_array id="ta" count="8">0 0 1 0 0 1 1 1</float_array>
      <technique_common><accessor source="#ta" count="4" stride="2"/></technique_common></source>
    <source id="u"><float_array id="ua" count="5">9 0.25 0.5 0.75 1</float_array>
      <technique_common><accessor source="#ua" count="2" offset="1" stride="2"/></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    {primitive}
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"##
    )
}

pub(crate) const TRIANGLE: &str = r##"<triangles count="1" material="m">
    <input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
    <p>0 0 1 0 2 0</p></triangles>"##;
const HERE: &str = r##"<node><instance_geometry url="#g"/></node>"##;

fn nodes(nodes: &str) -> TriMesh {
    parse(&document("", "", TRIANGLE, nodes), DaeUpAxis::Ignore).unwrap()
}

fn near(found: &[[f32; 3]], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (f, e) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((f - e).abs() < 1e-6, "{found:?}\n{expected:?}");
    }
}

const UP: [[f32; 3]; 3] = [[0., 0., 1.]; 3];

/// Transforms multiply parent by child, in document order. Mirrors swap corners so that the front stays outside.
#[test]
fn transforms() {
    let child = r##"<node><translate>1 0 0</translate><instance_geometry url="#g"/></node>"##;
    let shape = r##"<instance_geometry url="#g"/>"##;
    for (transforms, inner, expected) in [
        (
            "<rotate>0 0 1 90</rotate><translate>10 0 0</translate>",
            child,
            [[0., 11., 0.], [0., 12., 0.], [-1., 11., 0.]],
        ),
        ("<translate>10 0 0</translate><rotate>0 0 2 90</rotate>", child, [[10., 1., 0.], [10., 2., 0.], [9., 1., 0.]]),
        ("<scale>2 2 2</scale>", child, [[2., 0., 0.], [4., 0., 0.], [2., 2., 0.]]),
        ("<scale>-1 1 1</scale>", shape, [[0., 0., 0.], [0., 1., 0.], [-1., 0., 0.]]),
    ] {
        let mesh = nodes(&format!("<node>{transforms}{inner}</node>"));
        near(&mesh.positions, &expected);
        near(mesh.normals.as_ref().unwrap(), &UP);
    }
    // A shear of x along z keeps the plane z = 0, so the normal stays +z. The plain matrix would tilt the normal.
    let shear = "<matrix>.001 0 .001 0 0 .001 0 0 0 0 .001 0 0 0 0 1</matrix>";
    near(nodes(&format!("<node>{shear}{shape}</node>")).normals.as_ref().unwrap(), &UP);
    // One geometry three times, once through an instance of another node.
    let mesh = nodes(
        r##"<node id="a"><instance_geometry url="#g"/></node>
            <node><matrix>1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1</matrix><instance_geometry url="#g"/>
              <node><translate>0 0 1</translate><instance_node url="#a"/></node></node>"##,
    );
    let z: Vec<f32> = mesh.triangles.iter().map(|t| mesh.positions[t[0] as usize][2]).collect();
    assert_eq!(z, [0.0, 5.0, 6.0]);
}

#[test]
fn units_and_axes() {
    for (asset, option, expected) in [
        (r#"<unit meter="0.01"/>"#, DaeUpAxis::Ignore, [0., 0.01, 0.]),
        ("<up_axis>Y_UP</up_axis>", DaeUpAxis::Ignore, [0., 1., 0.]),
        (r#"<unit meter="2"/><up_axis>Y_UP</up_axis>"#, DaeUpAxis::Apply, [0., 0., 2.]),
        ("", DaeUpAxis::Apply, [0., 0., 1.]),
        ("<up_axis>Z_UP</up_axis>", DaeUpAxis::Apply, [0., 1., 0.]),
        ("<up_axis>X_UP</up_axis>", DaeUpAxis::Apply, [-1., 0., 0.]),
    ] {
        let mesh = parse(&document(asset, "", TRIANGLE, HERE), option).unwrap();
        near(&mesh.positions[2..], &[expected]);
    }
    let error = parse(&document(r#"<unit meter="0"/>"#, "", TRIANGLE, HERE), DaeUpAxis::Ignore).unwrap_err();
    assert_eq!(error.to_string(), "meshes/part.dae: line 3, <unit>: meter is not a positive number");
}

#[test]
fn primitives() {
    let input = r##"<input semantic="VERTEX" source="#v" offset="0"/>"##;
    for (primitive, triangles) in [
        (format!("<polylist count='2'>{input}<vcount>4 3</vcount><p>0 1 3 2 0 3 2</p></polylist>"), 3),
        (format!("<polygons count='2'>{input}<p>0 1 3 2</p><p>0 1 2</p></polygons>"), 3),
        (format!("<tristrips count='1'>{input}<p>0 1 2 3</p></tristrips>"), 2),
        (format!("<trifans count='1'>{input}<p>0 1<!-- half --> 3 2</p></trifans>"), 2),
        (format!("<lines count='1'>{input}<p>0 1</p></lines>{TRIANGLE}"), 1),
    ] {
        let mesh = parse(&document("", "", &primitive, HERE), DaeUpAxis::Ignore).unwrap();
        assert_eq!(mesh.triangles.len(), triangles, "{primitive}");
        for t in &mesh.triangles {
            assert!(faces_up(t.map(|i| mesh.positions[i as usize])), "{primitive} faces +z");
        }
    }
}

pub(crate) const MATERIALS: &str = r##"
  <library_images><image id="img"><init_from>file://../tex/my%20image.png</init_from></image></library_images>
  <library_effects>
    <effect id="e1"><profile_COMMON>
      <newparam sid="surf"><surface type="2D"><init_from>img</init_from></surface></newparam>
      <newparam sid="samp"><sampler2D><source>surf</source></sampler2D></newparam>
      <technique sid="c"><phong><diffuse><texture texture="samp" texcoord="UV1"/></diffuse></phong></technique>
    </profile_COMMON></effect>
    <effect id="e2"><profile_COMMON><technique sid="c"><blinn>
      <diffuse><color>0.5 0.25 0 0.75</color></diffuse></blinn></technique></profile_COMMON></effect>
  </library_effects>
  <library_materials>
    <material id="m1" name="wood"><instance_effect url="#e1"/></material>
    <material id="m2"><instance_effect url="#e2"/></material>
  </library_materials>"##;

pub(crate) const BOUND: &str = r##"<node><instance_geometry url="#g"><bind_material><technique_common>
    <instance_material symbol="a" target="#m1"><bind_vertex_input semantic="UV1" input_set="1"/></instance_material>
    <instance_material symbol="b" target="#m2"/>
  </technique_common></bind_material></instance_geometry></node>"##;

/// Two parts with a material and one without. The first one has two sets of texture coordinates.
pub(crate) const TWO_PARTS: &str = r##"
  <triangles material="a"><input semantic="VERTEX" source="#v" offset="0"/>
    <input semantic="TEXCOORD" source="#t" offset="0" set="0"/>
    <input semantic="TEXCOORD" source="#u" offset="1" set="1"/><p>0 0 1 1 2 0</p></triangles>
  <triangles material="b"><input semantic="VERTEX" source="#v" offset="0"/>
    <input semantic="TEXCOORD" source="#t" offset="0" set="0"/><p>1 3 2</p></triangles>
  <triangles material="c"><input semantic="VERTEX" source="#v" offset="0"/><p>1 2 3</p></triangles>"##;

#[test]
fn materials() {
    let mesh = parse(&document("", MATERIALS, TWO_PARTS, BOUND), DaeUpAxis::Ignore).unwrap();
    assert_eq!(mesh.submeshes.iter().map(|p| p.material).collect::<Vec<_>>(), [Some(0), Some(1), None]);
    assert_eq!(mesh.materials[0].name, "wood");
    assert_eq!(mesh.materials[0].texture, Some(TextureSource::File("meshes/../tex/my image.png".into())));
    assert_eq!((mesh.materials[1].name.as_str(), mesh.materials[1].rgba), ("m2", [0.5, 0.25, 0.0, 0.75]));
    let uvs = mesh.uvs.unwrap();
    assert_eq!(uvs[..3], [[0.25, 0.5], [0.75, 1.0], [0.25, 0.5]]);
    assert_eq!(uvs[mesh.triangles[1][1] as usize], [1.0, 1.0]);
}

#[test]
fn errors() {
    let text = document("", "", TRIANGLE, HERE);
    for (from, to, expected) in [
        (
            "1 0 2 0</p>",
            "1 0 4 0</p>",
            "line 15, <triangles>, POSITION index: index 4 is out of range; the number of elements is 4",
        ),
        (
            "1 0 2 0</p>",
            "1 0 2 1</p>",
            "line 15, <triangles>, NORMAL index: index 1 is out of range; the number of elements is 1",
        ),
        ("1 0 2 0</p>", "1 0</p>", "line 15, <triangles>: 2 corners in <p>; expected a multiple of 3"),
        ("1 0 2 0</p>", "1 0 x 0</p>", "line 17, <p>: \"x\" is not a number"),
        ("0 1 0 1 1 0<", "0 1 0 1 1 nan<", "no triangles"),
        ("0 1 0 1 1 0<", "0 inf 0 1 1 0<", "line 15, <triangles>: vertex position [NaN, inf, NaN] is not finite"),
        ("count=\"4\" stride=\"3\"", "count=\"5\" stride=\"3\"", "line 6, <source>: accessor of 5 rows of 3"),
        ("url=\"#g\"", "url=\"#h\"", "line 19, <instance_geometry>: no element of this file has the id \"h\""),
        ("url=\"#g\"", "url=\"a.dae#g\"", "line 19, <instance_geometry>: reference \"a.dae#g\" into another document"),
        ("<node>", "<node><skew>1</skew>", "line 19, <skew>: the transform <skew> is not supported"),
        ("<node>", "<node id=\"r\"><instance_node url=\"#r\"/>", "line 19, <node>: nodes nest deeper than 64"),
        ("</geometry>", "</geometri>", "line 18, column"),
        ("<COLLADA", "<COLLADO", "line"),
    ] {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text);
        let error = match parse(&changed, DaeUpAxis::Ignore) {
            Err(error) => error.to_string(),
            // The vertex with NaN is not used.
            Ok(_) if expected == "no triangles" => continue,
            Ok(_) => panic!("{to} passed"),
        };
        assert!(error.starts_with(&format!("meshes/part.dae: {expected}")), "{error}");
    }
    // The number of nodes doubles at each level: the limit of nodes ends the reading, not the time.
    let doubling: String = (0..40)
        .map(|i| format!(r##"<node id="d{i}"><instance_node url="#d{0}"/><instance_node url="#d{0}"/></node>"##, i + 1))
        .collect();
    let error = parse(&document("", "", TRIANGLE, &(doubling + r##"<node id="d40"/>"##)), DaeUpAxis::Ignore);
    assert!(matches!(error, Err(MeshError::TooLarge { .. })));
}
