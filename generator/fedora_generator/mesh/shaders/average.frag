// The mean over a pixel's own square of linear light: factor x factor fragments of SAMPLES samples each.
uniform sampler2DMS fine;
uniform int factor;
uniform int first_row;  // of the image, in row 0 of the fine one
uniform float gamma;

out vec4 mean;

vec3 fragment_mean(ivec2 at) {
    vec3 total = vec3(0.0);
    for (int i = 0; i < SAMPLES; ++i) total += texelFetch(fine, at, i).rgb;
    total /= float(SAMPLES);
    // What an 8-bit framebuffer resolves to: averaged and rounded as it is encoded, and only then decoded.
    return gamma == 1.0 ? total : pow(round(total * 255.0) / 255.0, vec3(gamma));
}

void main() {
    ivec2 first = (ivec2(gl_FragCoord.xy) - ivec2(0, first_row)) * factor;
    vec3 total = vec3(0.0);
    for (int row = 0; row < factor; ++row)
        for (int column = 0; column < factor; ++column) total += fragment_mean(first + ivec2(column, row));
    mean = vec4(total / float(factor * factor), 1.0);
}
