// Skinning, once a picture: the shadow map and the picture both draw what comes out.
// The palette holds, for each bone, three rows of world_from_rest.

uniform sampler2D bone_palette;

in vec3 in_position;
in vec3 in_normal;
in uvec4 in_bones;
in vec4 in_weights;

out vec3 position;
out vec3 normal;

void main() {
    ivec4 bones = ivec4(in_bones);
    vec4 row_x = vec4(0.0), row_y = vec4(0.0), row_z = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        row_x += in_weights[i] * texelFetch(bone_palette, ivec2(0, bones[i]), 0);
        row_y += in_weights[i] * texelFetch(bone_palette, ivec2(1, bones[i]), 0);
        row_z += in_weights[i] * texelFetch(bone_palette, ivec2(2, bones[i]), 0);
    }
    vec4 rest = vec4(in_position, 1.0);
    position = vec3(dot(row_x, rest), dot(row_y, rest), dot(row_z, rest));
    normal = vec3(dot(row_x.xyz, in_normal), dot(row_y.xyz, in_normal), dot(row_z.xyz, in_normal));
}
